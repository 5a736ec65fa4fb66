"""Registration of many pairs of scans: threads, processes or a cluster, one row for each pair.

What belongs here distributes pairs and collects rows. A single pair is registered in
`scanlock.registration`; sequences and studies are beside this package.
"""
