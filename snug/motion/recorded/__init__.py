"""Recorded clips of the library, under their own notice (NOTICE.md), not under the project's licence.

clips.npz holds them at 30 fps; table says what each shows and how it is cut.
"""
