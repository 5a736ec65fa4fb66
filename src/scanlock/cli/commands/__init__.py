"""The commands of the command line, one file each.

A command parses its arguments, calls the library and prints. Code for several commands belongs to
`scanlock.cli`, and computations belong to the library.
"""
