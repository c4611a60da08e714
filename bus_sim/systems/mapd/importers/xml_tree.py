"""XML elements with the lines on which they begin, for messages that name a place. Standard library only."""

from dataclasses import dataclass, field
from xml.parsers import expat

from onboard.config.problems import Problems

#: Deeper than any plant model.
_MOST_DEPTH = 50


@dataclass
class XmlElement:
    """One element: its name, attributes, the line of its start tag, and what is within."""

    name: str
    attributes: dict[str, str]
    line: int
    children: "list[XmlElement]" = field(default_factory=list)

    def all(self, name: str) -> "list[XmlElement]":
        """Its direct children of one name."""
        return [one for one in self.children if one.name == name]


def parse_xml(text: str, problems: Problems) -> XmlElement | None:
    """The root element; None, with a problem noted, where the text is not well formed or declares a document type.

    A document type is refused as its entities could grow without bound.
    """
    parser = expat.ParserCreate()
    top = XmlElement("", {}, 0)
    stack = [top]

    def start(name: str, attributes: dict[str, str]) -> None:
        if len(stack) > _MOST_DEPTH:
            raise ValueError("nested too deeply")
        element = XmlElement(name, attributes, parser.CurrentLineNumber)
        stack[-1].children.append(element)
        stack.append(element)

    def end(_: str) -> None:
        stack.pop()

    def doctype(*_: object) -> None:
        raise ValueError("a document type declaration")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(text, True)
    except (expat.ExpatError, ValueError) as error:
        what = expat.ErrorString(error.code) if isinstance(error, expat.ExpatError) else str(error)
        problems.add(parser.CurrentLineNumber, "", None, f"not usable XML: {what}", "export the model again")
        return None
    return top.children[0]
