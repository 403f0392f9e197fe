"""The kinds of task that a run consists of; task.py has what they share."""
