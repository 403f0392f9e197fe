"""Compiled closed forms for a CPU: recurrent networks, skinning, contact, one frame of a roll-out.

| module | what lies there |
| --- | --- |
| lanes | frames of a batch side by side in memory, as the kernels of training read them |
| gru | forward and backward of recurrent units and of linear layers |
| skinning | linear blend skinning of many frames, with its gradient |
| contact | energy of all contact samples from cached anchors |
| one_frame | network and skinning of a single frame |

The kernels of the energies lie beside their definitions (reference_sim.energies).
"""
