"""What the package offers: at the top, and in its rooms."""

from types import ModuleType

import toposeam as ts


def public_names():
    """Every public name as one writes it after ``ts.``, and what it stands for."""
    found = {}
    for name in ts.__all__:
        value = getattr(ts, name)
        if isinstance(value, ModuleType):
            found |= {f"{name}.{one}": getattr(value, one) for one in value.__all__}
        else:
            found[name] = value
    return found
