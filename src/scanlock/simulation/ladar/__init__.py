"""The facet ladar of Madhavan and Messina 2003 on a moving vehicle."""
