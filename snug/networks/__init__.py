"""Networks that dress a body: architectures, inputs, trained models, roll-outs.

| module | what lies there |
| --- | --- |
| garment_network | `GarmentNetwork`, the base of all architectures |
| regressor, pbns, motion_perceptron, santesteban2019, tailornet | one architecture each |
| handles, ncs | networks of a few affine transforms; Neural Cloth Simulation |
| initialisation | first weights by the rules of Keras and of torch |
| fitted | two learners without training steps: nearest poses, ridge regression |
| architectures | the table of kinds; `make_network` |
| dressed_body, motion_features | `DressedBody`: a garment on a body, and the inputs of networks |
| trained_model, tensor_file | `TrainedModel` and its file |
| frame_layout | a network and skinning laid out as one compiled call |
| roll_out | a network run over a motion, frame by frame: `snug.roll_out` |

>>> from snug.networks import ARCHITECTURES, make_network
>>> list(ARCHITECTURES)[:4]
['snug', 'dynamic', 'supervised', 'pbns']
>>> from snug.recipes import DEFAULT
>>> network = make_network("snug", 154, 1000, DEFAULT, seed=0)
>>> f"{network.megabytes:.1f} MB, reads {network.feature_set}"
'9.1 MB, reads motion'
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
