"""The contract of methods, scenes and metrics, checked on tiny scenes: the work of `benchmarks.check`.

check_files: from a user's files to lines of findings. check_method, check_scene, check_metric: the tasks that
call everything once. findings: complaints with their remedies.
"""
