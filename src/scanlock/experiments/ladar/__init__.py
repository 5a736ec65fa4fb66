"""The ladar experiment of Madhavan and Messina 2003."""
