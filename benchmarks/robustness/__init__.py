"""Success rates under difficult conditions: no start, far starts, unusable input, heavy load.

``any_start`` and ``far_pairs`` give no initial pose, ``basin`` measures the basin of convergence,
``auto_ablation`` and ``sgc_ndt_ablation`` switch single stages off, ``silent_failures`` counts
wrong poses that a library reports as valid, and ``stress`` registers from many threads and
processes at once. Errors of converged poses belong to ``accuracy``.
"""
