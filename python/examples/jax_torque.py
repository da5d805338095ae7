"""The model as a function for JAX, and so for NumPyro or BlackJAX: a callback, with its exact derivatives in both modes."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

import ramphold

jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call, unused-ignore]

Array = NDArray[np.float64]


def torque_function(motion: ramphold.Motion) -> Callable[[Any], Any]:
    """The torque (N m, shape (samples,)) of `motion` as a JAX function of the six parameters, in the order of `ramphold.BASE_PARAMETERS`."""
    samples = motion.time_s.size
    shape_of: Any = jax.ShapeDtypeStruct
    torque_shape = shape_of((samples,), np.float64)
    slopes_shape = shape_of((samples, len(ramphold.BASE_PARAMETERS)), np.float64)

    def value(parameters: Any) -> Array:
        return ramphold.simulate(np.asarray(parameters), motion).torque_nm

    def value_and_slopes(parameters: Any) -> tuple[Array, Array]:
        own = ramphold.simulate(np.asarray(parameters), motion, derivatives=True)
        assert own.jacobian is not None
        return own.torque_nm, own.jacobian

    @jax.custom_jvp
    def torque(parameters: Any) -> Any:
        return jax.pure_callback(value, torque_shape, parameters, vmap_method="sequential")

    @torque.defjvp
    def derivative(primals: Any, tangents: Any) -> Any:
        shapes = (torque_shape, slopes_shape)
        own, slopes = jax.pure_callback(value_and_slopes, shapes, primals[0], vmap_method="sequential")
        return own, slopes @ tangents[0]

    return torque
