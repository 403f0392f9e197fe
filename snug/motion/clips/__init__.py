"""Motions of the embedded library, as readable tables of angles and published curves.

make_clip lists them by name; posture turns angles into poses and a root path; actions, strikes and unseen are
tables of key angles, gait has curves of walking and running, turns stops within a frame.
"""
