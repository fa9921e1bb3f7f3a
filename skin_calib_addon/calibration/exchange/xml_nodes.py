"""Parse XML strictly: yield the children of the root one by one, with line numbers and without entities."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from xml.parsers import expat

from ...common.errors import listed
from ...common.findings import FoundError, show
from ...common.plain_text import BLOCK_LENGTH
from ...common.text import NumberError, real, whole
from .taxel_set import line

# Larger values of the next three: more memory for a malicious file.
MAX_XML_DEPTH = 16  # nesting levels
MAX_CHILD_NODES = 1000  # in one child of the root, by default; a cell has about 25
MAX_TEXT_LENGTH = 64  # characters of text that a node keeps; the number that it contains has fewer


class XmlError(FoundError):
    """The document is invalid in a line."""

    def __init__(self, code: str, number: int, message: str):
        super().__init__(code, line(number), message)


@dataclass
class Node:
    """An element with its content."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list["Node"] = field(default_factory=list)
    text: str = ""
    parent: "Node | None" = field(default=None, repr=False, compare=False)

    def child(self, tag: str) -> "Node":
        """Return the first child with this tag; raise XmlError without one."""
        for node in self.children:
            if node.tag == tag:
                return node
        raise XmlError("missing", self.line, f"starts an element {self.tag} without {tag}")

    def attribute(self, name: str) -> str:
        """Return the value of an attribute; raise XmlError if it is missing."""
        if name not in self.attributes:
            raise XmlError("missing", self.line, f"starts an element {self.tag} without the attribute {name}")
        return self.attributes[name]

    def only(self, names: Sequence[str]) -> None:
        """Raise XmlError if the element has other attributes: they could change what those with these names mean."""
        for name in self.attributes:
            if name not in names:
                message = f"has the attribute {show(name)} of {self.tag}, which is not supported; use {listed(names)}"
                raise XmlError("unknown-attribute", self.line, message)

    def whole(self, name: str) -> int:
        """Return the value of an attribute as integer; raise XmlError if it is not an integer."""
        try:
            return whole(self.attribute(name).strip())
        except NumberError as problem:
            raise XmlError(problem.code, self.line, f"{problem} ({self.tag} {name})") from problem

    def number(self) -> float:
        """Return the number that is the text of the element; raise XmlError if it is none, not finite, or too long."""
        if len(self.text) == MAX_TEXT_LENGTH:  # only its beginning may be kept, without the exponent
            message = f"has {show(self.text)} instead of a number of less than {MAX_TEXT_LENGTH} characters"
            raise XmlError("number", self.line, message)
        try:
            return real(self.text.strip())
        except NumberError as problem:
            raise XmlError(problem.code, self.line, str(problem)) from problem


def children_of_root(text: str, root: str, most_nodes: int = MAX_CHILD_NODES) -> Iterator[Node]:
    """Yield each child of the root element as soon as it is parsed."""
    path: list[Node] = []
    done: list[Node] = []
    nodes = 0
    parser = expat.ParserCreate()  # for text, it ignores the declared encoding

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal nodes
        node = Node(tag, attributes, parser.CurrentLineNumber, parent=path[-1] if path else None)
        nodes = nodes + 1 if len(path) > 1 else 0
        if not path and tag != root:
            raise XmlError("syntax", node.line, f"starts {show(tag)}; the root element must be {root}")
        if len(path) == MAX_XML_DEPTH:
            raise XmlError("depth", node.line, f"has more than {MAX_XML_DEPTH} nesting levels")
        if nodes > most_nodes:
            raise XmlError("size", node.line, f"starts element {nodes} in one {path[1].tag}; the limit is {most_nodes}")
        if len(path) > 1:
            path[-1].children.append(node)
        path.append(node)

    def end(tag: str) -> None:
        node = path.pop()
        if len(path) == 1:
            done.append(node)

    def data(piece: str) -> None:
        if len(path[-1].text) < MAX_TEXT_LENGTH:
            path[-1].text = (path[-1].text + piece).lstrip()[:MAX_TEXT_LENGTH]

    def entity(*_: object) -> None:
        raise XmlError("entity", parser.CurrentLineNumber, "declares an entity; remove it from the document")

    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, data
    parser.EntityDeclHandler = entity
    try:
        for at in range(0, len(text), BLOCK_LENGTH):
            parser.Parse(text[at : at + BLOCK_LENGTH], False)
            yield from done
            done.clear()
        parser.Parse("", True)
    except expat.ExpatError as problem:
        message = f"is not XML at column {problem.offset + 1}: {expat.ErrorString(problem.code)}"
        raise XmlError("syntax", problem.lineno, message) from problem
