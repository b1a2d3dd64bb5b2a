"""Elements of Mitsuba scene files as text."""


def _element(tag: str, type_: str, inner: tuple[str, ...], more: str = "") -> str:
    return f'<{tag} type="{type_}"{more}>{"".join(inner)}</{tag}>'


def shape(type_: str, *inner: str, name: str = "") -> str:
    return _element("shape", type_, inner, f' id="{name}"' if name else "")


def bsdf(type_: str, *inner: str) -> str:
    return _element("bsdf", type_, inner)


def emitter(type_: str, *inner: str) -> str:
    return _element("emitter", type_, inner)


def texture(name: str, type_: str, *inner: str) -> str:
    return _element("texture", type_, inner, f' name="{name}"')


def bitmap(name: str, file: str, *inner: str) -> str:
    return texture(name, "bitmap", text("filename", file), *inner)


def _value(tag: str, name: str, value: object) -> str:
    return f'<{tag} name="{name}" value="{value}"/>'


def number(name: str, value: float) -> str:
    return _value("float", name, value)


def text(name: str, value: str) -> str:
    return _value("string", name, value)


def flag(name: str, value: str = "true") -> str:
    return _value("boolean", name, value)


def rgb(name: str, value: str) -> str:
    return _value("rgb", name, value)


def spectrum(name: str, value: str) -> str:
    return _value("spectrum", name, value)


def point(name: str, value: str) -> str:
    return _value("point", name, value)


def vector(name: str, value: str) -> str:
    return _value("vector", name, value)


def to_world(*steps: str) -> str:
    return f'<transform name="to_world">{"".join(steps)}</transform>'


def to_uv(*steps: str) -> str:
    return f'<transform name="to_uv">{"".join(steps)}</transform>'


def move(value: str) -> str:
    return f'<translate value="{value}"/>'


def scale(value: str) -> str:
    return f'<scale value="{value}"/>'


def rotate(axis: str, degrees: float) -> str:
    return f'<rotate {axis}="1" angle="{degrees}"/>'


def look(origin: str, target: str) -> str:
    return f'<lookat origin="{origin}" target="{target}" up="0 1 0"/>'


GGX = text("distribution", "ggx")
RAW = flag("raw")
MATT = bsdf("diffuse")
