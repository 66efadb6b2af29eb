"""Material of the soft skin of a fingertip; skin.c and coupled.c have its contact laws."""

from typing import NamedTuple

Three = tuple[float, float, float]


class Skin(NamedTuple):
    """Material of the skin.

    Attributes:
        stiffness: stiffness of the foundation at small depths [N/m^3]. Silicone of 50 kPa (like
            Ecoflex 00-30), 5 mm thick: a fingertip is indented by 0.9 mm at 1 N, 1.8 mm at 4 N.
        hardening: relative growth of the stiffness with depth [1/m]. It doubles at 2.5 mm, half
            of the silicone's thickness.
        damping: relative growth of the pressure with the speed of approach [s/m]
            (Hunt and Crossley). Own choice: 1 % at 10 mm/s.
        shear: ratio of the stiffness along the surface to that across it. 0.7, as for bodies
            with a Poisson's ratio near 0.5 (Mindlin: 2 (1 - nu) / (2 - nu) = 0.67).
        engagement: depth at which half of the shear stiffness acts [m], because asperities come
            into contact one after the other. Own choice.
        shear_time: viscous part of the shear stiffness [s]. Own choice: it damps the oscillation
            of a bristle with a finger.
        stribeck: slip speed at which friction falls from static to kinetic [m/s]. Own choice,
            of the order measured on rubber (1 to 10 mm/s).
        memory: time constant that smooths a node's slip speed [s]. Own choice, below a sample.
        slipping: slip speed above which a node counts as slipping [m/s]. Own choice.
        shear_modulus: of an elastic body through which all nodes are coupled (coupled.c) [Pa];
            `stiffness` and `hardening` are not used then. 0: every node is a separate spring.
    """

    stiffness: float = 1e7
    hardening: float = 1 / 2.5e-3
    damping: float = 1.2
    shear: float = 0.7
    engagement: float = 0.3e-3
    shear_time: float = 1.2e-3
    stribeck: float = 4e-3
    memory: float = 4e-3
    slipping: float = 1e-4
    shear_modulus: float = 0.0


COUPLED = Skin(shear_modulus=50e3)
"""Skin whose nodes are coupled. Silicone of 150 kPa (like Dragon Skin 10): a half-space of it is
indented by a fingertip about as far as `Skin()`, whose softer silicone lies on a hard core: 1.0 mm
at 1 N, 2.6 mm at 4 N."""
COUPLED_PITCH = 0.00165
"""Distance of neighbouring nodes of that skin [m]: half of `NODE_PITCH`, because its contact is
smaller, and sticks on a part of it."""
