"""Fast kernels are found through the term that declares them, and a slow path is announced once."""

from __future__ import annotations

import warnings
from typing import ClassVar

import pytest

from reference_sim import Cloth, Potential
from reference_sim.energies import Gravity, Inertia, StretchSpring, StretchStVK
from reference_sim.kernels import fast_kernels
from reference_sim.kernels.fast_kernels import SlowPathWarning, fast_kernel
from reference_sim.minimise.compiled_lbfgs import CompiledLBFGS
from reference_sim.minimise.lbfgs import LBFGS
from tests.reference_sim.meshes import patch


class Softer(StretchStVK):
    """A subclass that may compute anything."""


class Same(StretchStVK):
    kernels: ClassVar = StretchStVK.kernels


@pytest.fixture
def cloth() -> Cloth:
    positions, faces = patch(0)
    return Cloth(positions, faces, pins=[0])


def test_what_a_class_inherits_is_not_its_own(cloth):
    assert fast_kernel(Same(cloth), "training_batch") and not fast_kernel(Softer(cloth), "training_batch")
    potential = Potential([Softer(cloth), Gravity(cloth), Inertia(cloth, 0.1)])
    with pytest.raises(ValueError, match="no kernel for the term 'strain'"):
        CompiledLBFGS(potential, max_iterations=1)


def test_a_slow_minimisation_is_announced_once(cloth):
    fast_kernels._warn_once.cache_clear()  # of what earlier tests have triggered
    slow = Potential([StretchStVK(cloth), StretchSpring(cloth), Inertia(cloth, 0.1)])
    with pytest.warns(SlowPathWarning, match="^LBFGS: no float32 kernel of StretchSpring: "):
        LBFGS(slow)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        LBFGS(slow)
        LBFGS(Potential([StretchStVK(cloth), StretchSpring(cloth)]))  # at rest there is no fast way
