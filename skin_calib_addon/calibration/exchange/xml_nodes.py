"""The children of an XML document's root, one small tree after the other, with lines; no entities, no surprises."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

from ...common.findings import error, show
from ...common.text import NumberError, whole
from .taxel_set import line

MAX_XML_DEPTH = 16
MAX_NODES = 1000  # in one child of the root, if not told: a cell has about 25
MAX_TEXT_LENGTH = 64  # characters of text that are kept of a node: it holds a number
CHUNK_LENGTH = 2**16  # characters that are parsed at once


class XmlError(Exception):
    """The document cannot be used; ``finding`` says why, and in which line."""

    def __init__(self, code: str, number: int, message: str):
        super().__init__(message)
        self.finding = error(code, line(number), message)


@dataclass
class Node:
    """An element with what is in it."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list["Node"] = field(default_factory=list)
    text: str = ""

    def child(self, tag: str) -> "Node":
        """The first child of that name; XmlError if there is none."""
        for node in self.children:
            if node.tag == tag:
                return node
        raise XmlError("missing", self.line, f"opens a {self.tag} without {tag}")

    def attribute(self, name: str) -> str:
        """What an attribute holds; XmlError if it is missing."""
        if name not in self.attributes:
            raise XmlError("missing", self.line, f"opens a {self.tag} without the attribute {name}")
        return self.attributes[name]

    def whole(self, name: str) -> int:
        """The integer that an attribute holds; XmlError if it holds none."""
        try:
            return whole(self.attribute(name).strip())
        except NumberError as problem:
            raise XmlError(problem.code, self.line, f"{problem} ({self.tag} {name})") from problem


def children_of_root(text: str, root: str, most_nodes: int = MAX_NODES) -> Iterator[Node]:
    """Each child of the root element, as soon as it is read; one may hold ``most_nodes`` elements.

    Raises
    ------
    XmlError
        If the text is not well-formed, has another root, declares an entity, or exceeds a limit.
    """
    path: list[Node] = []
    done: list[Node] = []
    nodes = 0
    parser = expat.ParserCreate()  # given text, not bytes, it does not heed the encoding that is declared

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal nodes
        node = Node(tag, attributes, parser.CurrentLineNumber)
        nodes = nodes + 1 if len(path) > 1 else 0
        if not path and tag != root:
            raise XmlError("syntax", node.line, f"opens {show(tag)}; a {root} is needed")
        if len(path) == MAX_XML_DEPTH:
            raise XmlError("depth", node.line, f"nests more than {MAX_XML_DEPTH} levels")
        if nodes > most_nodes:
            raise XmlError(
                "size", node.line, f"opens element {nodes} in one {path[1].tag}; at most {most_nodes} are read"
            )
        if len(path) > 1:
            path[-1].children.append(node)
        path.append(node)

    def end(tag: str) -> None:
        node = path.pop()
        if len(path) == 1:
            done.append(node)

    def data(piece: str) -> None:
        if len(path[-1].text) < MAX_TEXT_LENGTH:
            path[-1].text = (path[-1].text.lstrip() + piece)[:MAX_TEXT_LENGTH]

    def entity(*_: object) -> None:
        raise XmlError("entity", parser.CurrentLineNumber, "declares an entity; write the document without")

    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, data
    parser.EntityDeclHandler = entity
    try:
        for at in range(0, len(text), CHUNK_LENGTH):
            parser.Parse(text[at : at + CHUNK_LENGTH], False)
            yield from done
            done.clear()
        parser.Parse("", True)
    except expat.ExpatError as problem:
        message = f"is not XML at column {problem.offset + 1}: {expat.ErrorString(problem.code)}"
        raise XmlError("syntax", problem.lineno, message) from problem
