"""The human body: skeleton, parametric body, skinning, files of SMPL's family."""
