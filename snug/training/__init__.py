"""Training of garment networks.

| module | what lies there |
| --- | --- |
| train_network | training by one call, `snug.train_network`; `untrained_model` |
| training_loop, checkpoint | all steps, and between them log, validation, early stop, checkpoints |
| optimisation_step | `Trainer.step`: draw windows, predict, sum energies, update |
| kinds | which network learns from the energies, and which from simulated vertices |
| losses | the physics loss, distances from simulated vertices, PBNS's own material |
| contact | contact planes from cached anchors, searched anew as the network learns |
| training_set, augmentation | frames and windows of motions; clips made from limbs of other clips |
| simulated_data | simulated motions in a file |
| hidden_state_cache | states that windows of a recurrent network start from |
| divergence_guard, validation | batches that are too high; roll-outs of held-out motions |
| device, process_group, stopwatch | where it runs, with how many processes, how long each part takes |
| command | options and parts of `python -m snug.train` |

`snug` shows an example that trains.

>>> from snug.training import KINDS
>>> [name for name, kind in KINDS.items() if not kind.physics]
['supervised', 'santesteban2019', 'tailornet', 'nearest-poses', 'pose-regression']
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
