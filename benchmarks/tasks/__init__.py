"""The kinds of task that a run consists of. See task.py for what they have in common."""
