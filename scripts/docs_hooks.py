"""Hooks of MkDocs: formulas become MathML, and the command-line reference is made from the parsers.

MathML needs no script and no font of another server, so the pages are complete without a network.
"""

import argparse
import html
import logging
import re

from latex2mathml.converter import convert

from skin_calib_addon.cli import build_parser

log = logging.getLogger("mkdocs.plugins.skin_calib")  # a warning below "mkdocs" fails a strict build

COMMANDS_HERE = "<!-- commands -->"
# What pymdownx.arithmatex makes of $...$ and $$...$$.
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
CODE = re.compile(r"<code\b.*?</code>", re.DOTALL)


def on_page_markdown(markdown: str, **_) -> str:
    """Put the reference of all commands into the page that has the mark for it."""
    return markdown.replace(COMMANDS_HERE, command_reference()) if COMMANDS_HERE in markdown else markdown


def on_page_content(content: str, page, **_) -> str:
    """Replace each formula by MathML; warn of LaTeX that cannot be converted."""

    def mathml(match: re.Match) -> str:
        tag, latex = match[1], html.unescape(match[2]).strip()
        if r"\\" in latex and r"\begin" not in latex:  # several rows, as Sphinx takes them
            latex = rf"\begin{{align*}}{latex}\end{{align*}}"
        formula = convert(latex, display="block" if tag == "div" else "inline")
        if re.search(r"\\[a-zA-Z]|>&<", formula):  # an unknown command, or the & of an unknown environment
            log.warning("%s: cannot convert this formula to MathML: %s", page.file.src_uri, latex)
        return f'<{tag} class="formula">{formula}</{tag}>'

    content = FORMULA.sub(mathml, content)
    if "$$" in CODE.sub("", content):
        log.warning("%s: a displayed formula needs an empty line before and after it", page.file.src_uri)
    return content


def command_reference() -> str:
    """Write every command, its arguments and options as Markdown."""
    parser = build_parser()
    (commands,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    summaries = {choice.dest: choice.help or "" for choice in commands._choices_actions}
    return "\n".join(
        line for name in commands.choices for line in _command(name, summaries[name], commands.choices[name])
    )


def _command(name: str, summary: str, command: argparse.ArgumentParser) -> list[str]:
    usage = " ".join(command.format_usage().removeprefix("usage: ").split())
    lines = [f"## {name}", "", f"{summary[:1].upper()}{summary[1:]}.", "", "```text", usage, "```", ""]
    if command.description:
        lines += [_escaped(command.description), ""]
    lines += ["| argument | meaning |", "|---|---|"]
    shown = [action for action in command._actions if action.dest != "help"]
    lines += [f"| {_names(action)} | {_meaning(action, command)} |" for action in shown]
    return [*lines, ""]


def _names(action: argparse.Action) -> str:
    value = "" if action.nargs == 0 else f" {action.metavar or action.dest.upper()}"
    names = action.option_strings or [""]
    return ", ".join(f"`{(name + value).strip()}`" for name in names)


def _meaning(action: argparse.Action, command: argparse.ArgumentParser) -> str:
    text = command._get_formatter()._expand_help(action) if action.help else ""
    required = bool(action.option_strings) and action.required
    return _escaped("; ".join(part for part in (text, "required" if required else "") if part))


def _escaped(text: str) -> str:
    """Escape what Markdown would take for marks."""
    return re.sub(r"([|*<\[])", r"\\\1", text)
