"""Small changes of a module's source, each of which some test should notice.

A mutant replaces the text of one expression or statement and leaves all else as it was, so that
it can be shown as two lines. It is known by these, so that a sample stays the same when other
lines change.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass

_COMPARED = {
    ast.Lt: ("<=", ">"),
    ast.LtE: ("<", ">"),
    ast.Gt: (">=", "<"),
    ast.GtE: (">", "<"),
    ast.Eq: ("!=",),
    ast.NotEq: ("==",),
    ast.Is: ("is not",),
    ast.IsNot: ("is",),
    ast.In: ("not in",),
    ast.NotIn: ("in",),
}
_COMPUTED = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"),
    ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
    ast.BitXor: ("^", "&"),
    ast.RShift: (">>", "<<"),
}
_CALLED = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum"}
_CALLED |= {"cos": "sin", "sin": "cos", "floor": "ceil", "ceil": "floor", "any": "all"}
_SYMMETRIC = {"min", "max", "minimum", "maximum", "hypot", "isinstance", "zip"}
_NOT_CODE = ("annotation", "returns", "decorator_list", "type_params", "bases")


@dataclass(frozen=True)
class Mutant:
    """One change of one file.

    Attributes
    ----------
    path
        Of the file, from the root of the repository.
    start, end
        Which characters of the file's text are replaced.
    text
        By what.
    line
        The number of the first line changed, from 1.
    before, after
        The lines changed, without indentation, as they were and as they are.
    repeat
        How many mutants of the file before this one look the same.
    """

    path: str
    start: int
    end: int
    text: str
    line: int
    before: str
    after: str
    repeat: int = 0

    @property
    def name(self) -> str:
        """What stays the same while this line does."""
        again = f" ({self.repeat + 1})" if self.repeat else ""
        return f"{self.path}: {self.before} → {self.after}{again}"

    def rank(self, seed: str = "") -> str:
        """Return a number by chance that the name alone decides: a sample is the lowest ones."""
        return hashlib.sha256(f"{seed}{self.name}".encode()).hexdigest()

    def applied(self, source: str) -> str:
        """Return the file's text with the change."""
        return source[: self.start] + self.text + source[self.end :]

    def compiles(self, source: str) -> bool:
        """Return whether the change leaves a program."""
        try:
            compile(self.applied(source), self.path, "exec")
        except (SyntaxError, ValueError):
            return False
        return True


def mutants(path: str, source: str) -> list[Mutant]:
    """Return all mutants of a module, in the order of its lines."""
    text = _Text(source)
    found, seen = [], dict[tuple[str, str], int]()
    changes = sorted({(*text.span(node), new) for node, new in _changes(ast.parse(source), text)})
    for start, end, new in changes:
        first, last = source.rfind("\n", 0, start) + 1, f"{source}\n".index("\n", end)
        before = _in_one_line(source[first:last])
        after = _in_one_line(source[first:start] + new + source[end:last])
        repeat = seen[before, after] = seen.get((before, after), -1) + 1
        line = source.count("\n", 0, start) + 1
        found.append(Mutant(path, start, end, new, line, before, after, repeat))
    return found


class _Text:
    """Source whose nodes can be cut out: ast counts columns in bytes."""

    def __init__(self, source: str) -> None:
        self.source = source
        self._lines = source.splitlines(keepends=True)
        self._begins = [0]
        for line in self._lines:
            self._begins.append(self._begins[-1] + len(line))

    def span(self, node: ast.AST | tuple[int, int]) -> tuple[int, int]:
        if isinstance(node, tuple):
            return node
        return self._place(node.lineno, node.col_offset), self._place(
            node.end_lineno, node.end_col_offset
        )

    def of(self, node: ast.AST) -> str:
        start, end = self.span(node)
        return self.source[start:end]

    def between(self, left: ast.AST, right: ast.AST, old: str) -> tuple[int, int]:
        """Return where an operator stands between its operands."""
        start, end = self.span(left)[1], self.span(right)[0]
        place = self.source.index(old, start, end)
        return place, place + len(old)

    def _place(self, line: int, column: int) -> int:
        before = self._lines[line - 1].encode()[:column].decode()
        return self._begins[line - 1] + len(before)


_Change = tuple[ast.AST | tuple[int, int], str]


def _changes(tree: ast.AST, text: _Text) -> Iterator[_Change]:
    """Yield what to replace, a node or a span, and by what."""
    for name, value in ast.iter_fields(tree):
        if name in _NOT_CODE:
            continue
        for node in value if isinstance(value, list) else [value]:
            if isinstance(node, ast.AST) and not _names_only(node):
                yield from _of_expression(node, text)
                yield from _of_statement(node, text)
                yield from _changes(node, text)


def _of_expression(node: ast.AST, text: _Text) -> Iterator[_Change]:
    match node:
        case ast.Compare(left=left, ops=[operator], comparators=[right]):
            for new in _COMPARED[type(operator)]:
                yield node, f"{text.of(left)} {new} {text.of(right)}"
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _COMPUTED:
            old, new = _COMPUTED[type(operator)]
            yield text.between(left, right, old), new
        case ast.BoolOp(op=operator, values=[first, second, *_]):
            old, new = ("and", "or") if isinstance(operator, ast.And) else ("or", "and")
            yield text.between(first, second, old), new
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert(), operand=operand):
            yield node, text.of(operand)
        case ast.IfExp(body=body, orelse=other):
            yield node, f"({text.of(body)})"
            yield node, f"({text.of(other)})"
        case ast.Constant(value=bool(value)):
            yield node, str(not value)
        case ast.Constant(value=int(value) | float(value)):
            yield node, repr(value + 1)
            yield node, repr(value - 1) if value >= 1 else f"({value - 1!r})"
        case ast.Call(func=function, args=[first, second, *_]) if _name(
            function
        ) not in _SYMMETRIC and text.of(first) != text.of(second):
            span = text.span(first)[0], text.span(second)[1]
            yield span, f"{text.of(second)}, {text.of(first)}"
    if isinstance(node, ast.Call) and _name(node.func) in _CALLED:
        old, new = _name(node.func), _CALLED[_name(node.func)]
        end = text.span(node.func)[1]
        yield (end - len(old), end), new


def _of_statement(node: ast.AST, text: _Text) -> Iterator[_Change]:
    match node:
        case ast.AugAssign(target=target, op=operator, value=value) if type(operator) in _COMPUTED:
            old, new = _COMPUTED[type(operator)]
            yield text.between(target, value, f"{old}="), f"{new}="
            yield node, "pass"
        case ast.If(test=test) | ast.While(test=test):
            yield test, f"not ({text.of(test)})"
            if isinstance(node.body[-1], ast.Return | ast.Raise):
                yield node.body[-1], "pass"
        case ast.Continue():
            yield node, "break"
            yield node, "pass"
        case ast.Break():
            yield node, "continue"
        case ast.Expr(value=ast.Call()):
            yield node, "pass"
        case ast.Assign(targets=[target]) if not isinstance(target, ast.Name):
            yield node, "pass"


def _names_only(node: ast.AST) -> bool:
    """Return whether a statement holds nothing that runs: imports, texts, ``__all__``."""
    match node:
        case ast.Import() | ast.ImportFrom() | ast.Expr(value=ast.Constant()):
            return True
        case ast.Assign(targets=[ast.Name(id="__all__")]):
            return True
    return False


def _name(function: ast.AST) -> str:
    return getattr(function, "attr", getattr(function, "id", ""))


def _in_one_line(text: str) -> str:
    return " ".join(text.split())
