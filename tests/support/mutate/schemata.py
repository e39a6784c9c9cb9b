"""Writes a C++ source once more, with a numbered change at every place where one small mistake could
stand: order, sum, product, logic, condition, statement, constant. Which one acts is chosen when the
program runs (switch.h), so that all of a file are compiled once."""
import re
import clang.cindex
from clang.cindex import CursorKind as Kind

ORDER = {"<": "<", ">": ">", "<=": "l", ">=": "g"}
ARITHMETIC = {"+": "sum", "-": "difference", "*": "product", "/": "quotient"}
FIXED = {Kind.STATIC_ASSERT, Kind.CASE_STMT, Kind.ENUM_DECL, Kind.TEMPLATE_REF, Kind.LAMBDA_EXPR}
ASSIGNS = {"=", "+=", "-=", "*=", "/=", "|=", "&="}


class Writer:
    """Collects insertions into one source text."""

    def __init__(self, path, text, first, without):
        self.path, self.text, self.next, self.without = path, text, first, without
        self.edits, self.mutants, self.order = [], [], 0
        self.taken = set()  # extents: a comparison of times stands in the tree more than once

    def number(self, cursor, what, count=1):
        first = self.next
        for i in range(count):
            self.mutants.append({"number": first + i, "line": cursor.location.line,
                                 "what": what[i] if count > 1 else what})
        self.next += count
        return first

    def around(self, begin, end, before, after):
        self.order += 1
        # Outer insertions come first at a common begin, last at a common end.
        self.edits.append((begin, 1, self.order, begin, before))
        self.edits.append((end, 0, -self.order, end, after))

    def replace(self, begin, end, new):
        self.order += 1
        self.edits.append((begin, 2, self.order, end, new))

    def result(self):
        out, at = [], 0
        for begin, _, _, end, new in sorted(self.edits):
            if begin < at:
                raise ValueError(f"{self.path}: edits overlap at {begin}")
            # A line keeps its number: by it an error of the compiler is told to its mutants.
            out += [self.text[at:begin], new, "\n" * self.text[begin:end].count("\n")]
            at = end
        return "".join(out) + self.text[at:]


def extent(cursor):
    return cursor.extent.start.offset, cursor.extent.end.offset


def is_number(cursor):
    kind = cursor.type.get_canonical().kind.name
    return kind in ("DOUBLE", "FLOAT", "INT", "UINT", "LONG", "ULONG", "LONGLONG", "ULONGLONG",
                    "UCHAR", "USHORT", "SHORT", "SCHAR", "CHAR_S", "CHAR_U")


def time_type(cursor):
    """Instant or Duration of daemon/core/base/mono_time.h; else nothing."""
    name = cursor.type.get_canonical().spelling.removeprefix("const ").rstrip(" &")
    return {"beltgrip::daemon::MonoTime": "Instant", "beltgrip::daemon::Duration": "Duration"}.get(name)


def operator(writer, left, right):
    """Text between two operands, and where it stands: only if it is a bare operator."""
    begin, end = extent(left)[1], extent(right)[0]
    found = re.fullmatch(r"\s*(\S{1,2})\s*", writer.text[begin:end])
    return (found.group(1), begin, end) if found else (None, begin, end)


def binary(writer, cursor):
    operands = list(cursor.get_children())
    if len(operands) != 2:
        return
    sign, begin, end = operator(writer, *operands)
    whole = extent(cursor)
    if sign in ORDER and is_number(operands[0]) and is_number(operands[1]):
        k = writer.number(cursor, f"{sign} at its edge")
        writer.around(*whole, f"::mutant::order({k}, '{ORDER[sign]}', ", ")")
        writer.replace(begin, end, ", ")
    elif sign in ARITHMETIC and all(map(is_number, operands)):
        k = writer.number(cursor, {"+": "+ is -", "-": "- is +"}.get(sign, f"{sign} left out"))
        writer.around(*whole, f"::mutant::{ARITHMETIC[sign]}({k}, ", ")")
        writer.replace(begin, end, ", ")
    elif sign in ("&&", "||") and cursor.type.spelling == "bool":
        k = writer.number(cursor, f"{sign} is {'||' if sign == '&&' else '&&'}")
        writer.around(*whole, f"::mutant::flip({k}, ", ")")
        for each in operands:
            writer.around(*extent(each), f"::mutant::flip({k}, static_cast<bool>(", "))")


def time_operator(writer, cursor):
    """The same between instants and spans, where the changed one compiles, too."""
    operands = list(cursor.get_children())
    whole = extent(cursor)
    if len(operands) != 3 or whole in writer.taken:
        return
    left, _, right = operands
    kinds = (time_type(left), time_type(right))
    sign, begin, end = operator(writer, left, right)
    if sign in ORDER and None not in kinds:
        k = writer.number(cursor, f"{sign} at its edge")
        call = f"::mutant::order({k}, '{ORDER[sign]}', "
    elif sign in ("+", "-") and kinds[1] == "Duration":
        k = writer.number(cursor, {"+": "+ is -", "-": "- is +"}[sign])
        call = f"::mutant::{ARITHMETIC[sign]}({k}, "
    elif sign in ("*", "/") and kinds == ("Duration", None):
        k = writer.number(cursor, f"{sign} left out")
        call = f"::mutant::{ARITHMETIC[sign]}({k}, "
    else:
        return
    writer.taken.add(whole)
    writer.around(*whole, call, ")")
    writer.replace(begin, end, ", ")


def condition(writer, cursor):
    children = list(cursor.get_children())
    if not children or children[0].kind == Kind.DECL_STMT or children[0].kind == Kind.VAR_DECL:
        return
    if writer.text[extent(cursor)[0]:].startswith("if constexpr"):
        return
    k = writer.number(cursor, ("condition is true", "condition is false"), 2)
    writer.around(*extent(children[0]), f"::mutant::decide({k}, static_cast<bool>(", "))")


def statement(writer, cursor):
    text = writer.text[slice(*extent(cursor))]
    k = writer.number(cursor, "left out: " + " ".join(text.split())[:60])
    writer.around(*extent(cursor), f"if (!::mutant::on({k})) ", "")


def constant(writer, cursor):
    told = cursor.referenced
    if told is None or told.kind != Kind.VAR_DECL:
        return
    if not is_number(cursor) and time_type(cursor) != "Duration":
        return
    tokens = [each.spelling for each in told.get_tokens()]
    if "constexpr" not in tokens:
        return
    name = writer.text[slice(*extent(cursor))]
    k = writer.number(cursor, (f"{name} half as large again", f"{name} two thirds"), 2)
    writer.around(*extent(cursor), f"::mutant::scaled({k}, ", ")")


def call(writer, cursor):
    begin, _ = extent(cursor)
    if cursor.spelling not in ("min", "max"):
        return
    for name, switch in (("std::min(", "Least"), ("std::max(", "Largest")):
        if writer.text.startswith(name, begin):
            k = writer.number(cursor, f"{name[:-1]} is the other")
            writer.replace(begin, begin + len(name) - 1, f"::mutant::{switch}{{{k}}}")


def visit(writer, cursor, inside, parent):
    if cursor.kind in FIXED or (cursor.kind == Kind.VAR_DECL and "constexpr" in
                                [each.spelling for each in cursor.get_tokens()][:4]):
        return
    if cursor.location.file and cursor.location.file.name != writer.path:
        return
    if inside and cursor.location.line not in writer.without and parent.kind == Kind.COMPOUND_STMT:
        children = list(cursor.get_children())
        assigns = (cursor.kind in (Kind.BINARY_OPERATOR, Kind.COMPOUND_ASSIGNMENT_OPERATOR) and
                   len(children) == 2 and operator(writer, *children)[0] in ASSIGNS)
        if assigns or cursor.kind in (Kind.CALL_EXPR, Kind.UNARY_OPERATOR):
            statement(writer, cursor)
    if inside and cursor.location.line not in writer.without:
        kind = cursor.kind
        if kind == Kind.BINARY_OPERATOR:
            binary(writer, cursor)
        elif kind == Kind.IF_STMT:
            condition(writer, cursor)
        elif kind == Kind.DECL_REF_EXPR:
            constant(writer, cursor)
        elif kind == Kind.CALL_EXPR and cursor.spelling.startswith("operator"):
            time_operator(writer, cursor)
        elif kind == Kind.CALL_EXPR:
            call(writer, cursor)
    body = inside or (cursor.kind == Kind.COMPOUND_STMT)
    for each in cursor.get_children():
        visit(writer, each, body, cursor)


def mutate(path, arguments, first, without=frozenset()):
    """The mutated text, and the list of its mutants, numbered from first on. without: lines that keep none."""
    unit = clang.cindex.Index.create().parse(path, args=arguments)
    errors = [each for each in unit.diagnostics if each.severity >= 3]
    if errors:
        raise ValueError(f"{path}: {errors[0]}")
    text = open(path, encoding="utf-8").read()
    if not text.isascii():
        raise ValueError(f"{path}: not ASCII: offsets would differ")
    writer = Writer(path, text, first, without)
    visit(writer, unit.cursor, False, None)
    return '#include "tests/support/mutate/switch.h"\n' + writer.result(), writer.mutants
