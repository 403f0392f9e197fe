"""The human body: skeleton, parametric body, skinning, and files of SMPL's family."""
