"""Files of one Mitsuba scene: found only inside its folder, and XML read under limits."""

from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from pcii.base.errors import InputError
from simgen.base.asset_names import asset

LARGEST_XML_BYTES = 1 << 23
"""Of a scene file and all that it includes."""
MOST_ELEMENTS = 100_000
MOST_FILES = 2000
DEEPEST = 64
LONGEST_ATTRIBUTE = 1 << 16


@dataclass(frozen=True, slots=True)
class Element:
    """An XML element; text between elements has no meaning in a scene and is left out."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: "list[Element]" = field(default_factory=list)


class SceneFiles:
    """Finds and reads the files of one scene; the limits hold for all of them together."""

    def __init__(self, scene: Path) -> None:
        self._scene = scene
        self._folder = scene.parent
        self._found: dict[tuple[Path, str], Path] = {}
        self._bytes = 0
        self._elements = 0
        self._read = 0

    def find(self, name: str, place: str, beside: Path | None = None) -> Path:
        """A file of this name; `InputError`, beginning with `place`, unless it is inside the scene's folder.

        A file in the folder of the file `beside`, which names it, goes before one in the scene's folder.
        """
        near = (beside or self._scene).parent.resolve()
        if (near, name) not in self._found:
            if len(self._found) >= MOST_FILES:
                raise InputError(
                    f"{place}: a scene here may name {MOST_FILES} files, and this one names more"
                )
            self._found[near, name] = self._near(near, name, place) or asset(self._folder, name, place)
        return self._found[near, name]

    def _near(self, folder: Path, name: str, place: str) -> Path | None:
        """A file in a folder inside the scene's, if it is there."""
        root = self._folder.resolve()
        if folder == root or Path(name).is_absolute():
            return None
        try:
            return asset(self._folder, str(folder.relative_to(root) / name), place)
        except InputError:
            return None

    def read_xml(self, path: Path, depth: int) -> Element:
        """The root of an XML file; `InputError` with file and line if it is none, or beyond the limits.

        Its elements count as nested in as many more as `depth` says: those around the place of an include.
        """
        self._read += 1
        if self._read > MOST_FILES:
            raise InputError(
                f"{path}: a scene here may include {MOST_FILES} files, and this one includes more"
            )
        if path.is_dir():
            raise InputError(f"{path}: this is a folder, not an XML file")
        if not path.is_file():  # nor a pipe, which would block
            raise InputError(f"{path}: there is no such file")
        left = LARGEST_XML_BYTES - self._bytes
        with path.open("rb") as file:
            data = file.read(left + 1)
        if len(data) > left:
            raise InputError(
                f"{path}: a scene here may have {LARGEST_XML_BYTES} bytes of XML, and this one has more"
            )
        self._bytes += len(data)
        if not data.strip():
            raise InputError(f"{path}: this file is empty; a Mitsuba scene file is XML")
        try:
            data.decode()
        except UnicodeDecodeError as fault:
            line = data.count(b"\n", 0, fault.start) + 1
            raise InputError(f"{path}: line {line}: not UTF-8 text; save it as UTF-8") from None
        return self._tree(path, data, depth)

    def _tree(self, path: Path, data: bytes, depth: int) -> Element:
        # Whatever encoding a document claims, it is UTF-8.
        parser = expat.ParserCreate("utf-8")
        top = Element("", {}, 0)
        open_ones = [top]

        def refuse(what: str) -> None:
            raise InputError(f"{path}: line {parser.CurrentLineNumber}: {what}")

        def start(tag: str, attributes: dict[str, str]) -> None:
            self._elements += 1
            if self._elements > MOST_ELEMENTS:
                refuse(f"a scene here may have {MOST_ELEMENTS} elements, and this one has more")
            if depth + len(open_ones) > DEEPEST:
                refuse(f"elements may be nested {DEEPEST} deep, and these are deeper")
            if any(len(text) > LONGEST_ATTRIBUTE for text in attributes.values()):
                refuse(f"an attribute may have {LONGEST_ATTRIBUTE} characters, and this one has more")
            element = Element(tag, attributes, parser.CurrentLineNumber)
            open_ones[-1].children.append(element)
            open_ones.append(element)

        parser.StartElementHandler = start
        parser.EndElementHandler = lambda _: open_ones.pop()
        # Entities, which could grow without bound or name other files, are declared nowhere else.
        parser.StartDoctypeDeclHandler = lambda *_: refuse(
            "a scene file has no DOCTYPE and declares no entities; remove it"
        )
        try:
            parser.Parse(data, True)
        except expat.ExpatError as fault:
            raise InputError(
                f"{path}: line {fault.lineno}: not valid XML: {expat.ErrorString(fault.code)}"
            ) from None
        return top.children[0]
