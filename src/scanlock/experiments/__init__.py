"""The papers' experiments, each by one command."""
