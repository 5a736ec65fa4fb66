"""Settings of methods as TOML text and files."""
