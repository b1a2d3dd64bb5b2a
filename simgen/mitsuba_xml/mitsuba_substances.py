"""Substances that Mitsuba knows by name: refractive indices, and the colours of metals.

Mitsuba 3.9, include/mitsuba/render/ior.h (of Hecht, Optics, at 589 nm) and data/ior.
"""

from types import MappingProxyType

REFRACTIVE_INDEX = MappingProxyType(
    {
        **{"vacuum": 1.0, "helium": 1.000036, "hydrogen": 1.000132, "air": 1.000277},
        **{"carbon dioxide": 1.00045, "water": 1.333, "acetone": 1.36, "ethanol": 1.361},
        **{"carbon tetrachloride": 1.461, "glycerol": 1.4729, "benzene": 1.501, "silicone oil": 1.52045},
        **{"bromine": 1.661, "water ice": 1.31, "fused quartz": 1.458, "pyrex": 1.47},
        **{"acrylic glass": 1.49, "polypropylene": 1.49, "bk7": 1.5046, "sodium chloride": 1.544},
        **{"amber": 1.55, "pet": 1.575, "diamond": 2.419},
    }
)

METALS = MappingProxyType(
    {
        "Ag": (0.9748, 0.9575, 0.9063),
        "Al": (0.9280, 0.9178, 0.9189),
        "AlAs": (0.3200, 0.2783, 0.1430),
        "Au": (0.9667, 0.8020, 0.3241),
        "Be": (0.5975, 0.5206, 0.5062),
        "Cr": (0.6876, 0.6491, 0.6870),
        "CsI": (0.1325, 0.0675, 0.0619),
        "Cu": (0.9520, 0.6198, 0.5106),
        "Cu2O": (0.3147, 0.2455, 0.2379),
        "CuO": (0.2907, 0.1982, 0.1834),
        "Hg": (0.8140, 0.7702, 0.7631),
        "HgTe": (0.4699, 0.3665, 0.3507),
        "Ir": (0.7426, 0.6802, 0.6308),
        "K": (0.9539, 0.9363, 0.9201),
        "Li": (0.9248, 0.8844, 0.7933),
        "MgO": (0.1244, 0.0603, 0.0526),
        "Mo": (0.6182, 0.5618, 0.5409),
        "Na_palik": (0.9785, 0.9597, 0.9315),
        "Nb": (0.5640, 0.4895, 0.4731),
        "Ni_palik": (0.7001, 0.5942, 0.4936),
        "Rh": (0.8243, 0.7544, 0.7216),
        "Se": (0.3793, 0.2507, 0.2413),
        "SiC": (0.2711, 0.1873, 0.1808),
        "SnTe": (0.4070, 0.1084, 0.0152),
        "Ta": (0.4565, 0.3419, 0.3799),
        "Te": (0.6350, 0.5781, 0.5617),
        "ThF4": (0.0861, 0.0328, 0.0264),
        "TiC": (0.5482, 0.4397, 0.4116),
        "TiN": (0.6409, 0.4523, 0.1976),
        "TiO2": (0.3039, 0.2246, 0.2380),
        "VC": (0.5297, 0.4179, 0.3798),
        "VN": (0.5251, 0.3926, 0.3106),
        "V_palik": (0.5727, 0.5107, 0.5365),
        "W": (0.5746, 0.4778, 0.4331),
        "a-C": (0.2794, 0.1940, 0.1691),
        "d-C": (0.2123, 0.1579, 0.1449),
    }
)
"""Reflectance at normal incidence, linear sRGB, as Mitsuba's variants in colours have it."""
