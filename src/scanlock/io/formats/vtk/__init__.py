"""VTK files: the legacy format (.vtk) and the XML format of polygonal data (.vtp).

Both are read for their points and point data. What other formats share is in
`scanlock.io.formats`.
"""
