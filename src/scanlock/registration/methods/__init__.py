"""Registration methods: settings with `prepare` and `align`, one file each."""
