#!/usr/bin/env python3
"""Writes from the public headers what states the binary interface twice, for either side to check:

    addon/volley/abi.py             enumerators, structures and functions for Python's ctypes
    libtracer/src/api/abi_table.c   the values, sizes and offsets that the C compiler gave them

    python3 libtracer/tools/generate_abi.py [--check]

--check writes nothing and fails if one of the files is not what the headers say.

The headers are read as text, in the subset of C that they keep to: enumerations, structures and
functions with a name, one declarator list to a line's end, limits as macros without parameters, and lists
(tracer/*.def) that a macro defined just before makes enumerators of.
"""

import argparse
import re
import sys
from collections import namedtuple
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
INCLUDE = ROOT / "libtracer" / "include"
PYTHON = ROOT / "addon" / "volley" / "abi.py"
TABLE = ROOT / "libtracer" / "src" / "api" / "abi_table.c"
LINE_LENGTH = 110

# tag: without trc_, None where there is none; members: [(name, value)], names as in C.
Enumeration = namedtuple("Enumeration", "tag members")
# base: the C type without const and *; pointers: how many *; length: of an array, else 0.
Variable = namedtuple("Variable", "base pointers length name")
Structure = namedtuple("Structure", "name fields")
Function = namedtuple("Function", "name result arguments")
# label: for people; inputs, outputs: [(kind, name)].
Node = namedtuple("Node", "name label inputs outputs")
# channels: a letter each; of a range count passes from the named one on.
Pass = namedtuple("Pass", "name channels")
PassRange = namedtuple("PassRange", "name count channels")
Interface = namedtuple("Interface", "constants enumerations structures functions typedefs nodes "
                                    "passes pass_ranges")

_CTYPES = {"int32_t": "c_int32", "uint32_t": "c_uint32", "uint64_t": "c_uint64", "int64_t": "c_int64",
           "uint16_t": "c_uint16", "uint8_t": "c_uint8", "float": "c_float", "double": "c_double"}


# Reading ---------------------------------------------------------------------------------------

def header_paths(include=INCLUDE):
    """The headers that declare something, in the order of their names."""
    return sorted(path for path in (include / "tracer").glob("*.h") if path.name != "tracer.h")


def read_interface(include=INCLUDE):
    """All that the public headers declare."""
    interface = Interface({}, [], [], [], {}, [], [], [])
    text = "\n".join(_without_comments(path.read_text()) for path in header_paths(include))
    text = _read_macros(_expand_lists(text, include), interface)
    _read_declarations(text, interface)
    interface.nodes.extend(_read_nodes(_list_text(include / "tracer" / "nodes.def")))
    passes = _list_text(include / "tracer" / "passes.def")
    interface.passes.extend(Pass(name, channels.strip('"'))
                            for name, _, channels, *_ in _calls(passes, "TRC_PASS"))
    interface.pass_ranges.extend(PassRange(name, _number(count, interface), channels.strip('"'))
                                 for name, _, count, channels, *_ in _calls(passes, "TRC_PASS_RANGE"))
    return interface


def _list_text(path):
    """A list without its comments, and with macros that it says are others as those; empty where there is
    none."""
    text = _without_comments(path.read_text()) if path.is_file() else ""
    for name, other in re.findall(r"^#define (\w+) (\w+)$", text, flags=re.M):
        text = re.sub(rf"\b{name}\(", f"{other}(", text)
    return text


def _without_comments(text):
    text = text.replace("\\\n", " ")
    return re.sub(r'("(?:[^"\\]|\\.)*")|/\*.*?\*/', lambda match: match[1] or " ", text, flags=re.S)


def _expand_lists(text, include):
    """The text with '#define MACRO(...) ...' and '#include "x.def"' as what the two come to."""
    pattern = r'#define (\w+)\(([^)]*)\) (.*)\n((?:#define .*\n)*)\s*#include "(\w+/\w+\.def)"'

    def expand(match):
        name, parameters, body, _, path = match.groups()
        parameters = [parameter.strip() for parameter in parameters.split(",")]
        entries = _calls(_list_text(include / path), name)
        return "\n".join(_substitute(body, dict(zip(parameters, entry))) for entry in entries)
    return re.sub(pattern, expand, text)


def _substitute(body, arguments):
    words = re.sub(r"\b\w+\b", lambda match: arguments.get(match[0], match[0]),
                   re.sub(r"##\s*(\w+)", lambda match: "##" + arguments.get(match[1], match[1]), body))
    return re.sub(r"\s*##\s*", "", words)


def _calls(text, name):
    """The arguments of each NAME(...) in a text that is not a directive, as lists of strings."""
    text = re.sub(r"^#.*$", "", text, flags=re.M)
    for match in re.finditer(rf"\b{name}\(", text):
        depth, arguments, quoted = 1, [""], False
        for letter in text[match.end():]:
            quoted ^= letter == '"'
            depth += 0 if quoted else (letter == "(") - (letter == ")")
            if depth == 0:
                break
            if letter == "," and depth == 1 and not quoted:
                arguments.append("")
            else:
                arguments[-1] += letter
        yield [argument.strip() for argument in arguments]


def _read_nodes(text):
    for name, _, label, inputs, outputs, *_ in _calls(text, "TRC_NODE"):
        yield Node(name, label.strip('"'), [tuple(pair) for pair in _calls(inputs, "TRC_IN")],
                   [tuple(pair) for pair in _calls(outputs, "TRC_OUT")])


def _read_macros(text, interface):
    """Takes the macros that are numbers, and returns the text without directives."""
    for name, value in re.findall(r"^#define (TRC_\w+) +(\S.*)$", text, flags=re.M):
        if re.match(r"[\w(]", value) and not re.match(r"(__|extern)", value):
            interface.constants[name] = _number(value, interface)
    return re.sub(r"^\s*#.*$", "", text, flags=re.M)


def _number(expression, interface):
    """The value of an integer expression; names: enumerators and macros read so far."""
    known = dict(interface.constants)
    for enumeration in interface.enumerations:
        known.update(enumeration.members)
    expression = re.sub(r"\b(0[xX][0-9a-fA-F]+|\d+)[uUlL]*\b", r"\1", expression)
    return int(eval(expression, {"__builtins__": {}}, known))  # of our own headers


def _read_declarations(text, interface):
    text = re.sub(r"\bTRC_(BEGIN_DECLS|END_DECLS|API)\b", " ", text)
    pattern = re.compile(
        r"enum\s*(?P<tag>\w*)\s*{(?P<members>[^}]*)}\s*;"
        r"|typedef\s+struct\s+\w+\s*{(?P<fields>[^}]*)}\s*(?P<structure>\w+)\s*;"
        r"|typedef\s+(?P<base>\w+)\s+(?P<alias>\w+)\s*;"
        r"|(?P<result>[^;{}()]*?)(?P<function>\btrc_\w+)\s*\((?P<arguments>[^)]*)\)\s*;")
    end = 0
    for match in pattern.finditer(text):
        if text[end:match.start()].strip():
            break
        end = match.end()
        if match["members"] is not None:
            interface.enumerations.append(_enumeration(match["tag"], match["members"], interface))
        elif match["structure"]:
            fields = [variable for line in match["fields"].split(";") if line.strip()
                      for variable in _variables(line, interface)]
            interface.structures.append(Structure(match["structure"], fields))
        elif match["alias"]:
            interface.typedefs[match["alias"]] = match["base"]
        else:
            arguments = [] if match["arguments"].strip() == "void" else [
                _variables(argument, interface)[0] for argument in match["arguments"].split(",")]
            result = _variables(match["result"] + " result", interface)[0]
            interface.functions.append(Function(match["function"], result, arguments))
    if text[end:].strip():
        raise SystemExit(f"cannot read: {' '.join(text[end:end + 200].split())}")


def _enumeration(tag, body, interface):
    members, value = [], -1
    for entry in filter(None, (part.strip() for part in body.split(","))):
        name, _, expression = (part.strip() for part in entry.partition("="))
        value = _number(expression, interface) if expression else value + 1
        members.append((name, value))
    return Enumeration(tag.removeprefix("trc_") or None, members)


def _variables(line, interface):
    """The variables of a declaration such as 'const float *a, *b'."""
    first, *others = line.replace("const ", " ").split(",")
    base, declarator = re.match(r"\s*(\w+)\s*(.*)", first, flags=re.S).groups()
    variables = []
    for part in (declarator, *others):
        stars, name, length = re.match(r"\s*((?:\*\s*)*)(\w+)\s*(?:\[(\w+)\])?\s*$", part).groups()
        variables.append(Variable(base, stars.count("*"), _number(length, interface) if length else 0,
                                  name))
    return variables


# Writing ---------------------------------------------------------------------------------------

def class_name(name):
    """trc_camera_desc: CameraDesc."""
    return "".join(word.capitalize() for word in name.removeprefix("trc_").split("_"))


def member_prefix(enumeration):
    """What the members of an enumeration lose in Python: TRC_ and the words that all of them share with
    the tag."""
    tag = enumeration.tag.upper().split("_")
    for count in range(len(tag), 0, -1):
        prefix = "TRC_" + "_".join(tag[:count]) + "_"
        if all(name.startswith(prefix) for name, _ in enumeration.members):
            return prefix
    return "TRC_"


def _wrapped(head, parts, tail):
    """Parts after each other, in lines that are not too long; continued below the end of head."""
    lines, line = [], head
    for i, part in enumerate(parts):
        piece = part + (tail if i == len(parts) - 1 else ",")
        if len(line) + len(piece) + 1 > LINE_LENGTH:
            lines.append(line.rstrip())
            line = " " * len(head)
        line += piece + " "
    return "\n".join([*lines, line.rstrip()]) if parts else head + tail


def python_text(interface):
    """addon/volley/abi.py."""
    parts = [""]  # the head, which depends on what the rest needs
    tagged = [enumeration for enumeration in interface.enumerations if enumeration.tag]
    constants = _plain_constants(interface)
    parts.append("\n".join(f"{name.removeprefix('TRC_')} = {value}" for name, value in constants.items())
                 + "\n")
    for enumeration in tagged:
        kind = "IntFlag" if re.search(r"_(flags|rays)$", enumeration.tag) else "IntEnum"
        prefix = member_prefix(enumeration)
        members = "\n".join(f"    {name.removeprefix(prefix)} = {value}"
                            for name, value in enumeration.members)
        parts.append(f"\nclass {class_name(enumeration.tag)}({kind}):\n{members}\n")
    for structure in interface.structures:
        fields = [f'("{field.name}", {_field_type(field, interface)})' for field in structure.fields]
        parts.append(f"\nclass {class_name(structure.name)}(Structure):\n    __slots__ = ()\n"
                     + _wrapped("    _fields_ = (", fields, ")") + "\n")
    parts.append(_PYTHON_TABLES)
    parts.append(_wrapped("CONSTANTS = {", [f'"{name}": {name.removeprefix("TRC_")}'
                                            for name in constants], "}") + "\n")
    parts.append("# Enumerations, with what their members' names begin with in C.\n" + _wrapped(
        "ENUMERATIONS = {", [f'{class_name(enumeration.tag)}: "{member_prefix(enumeration)}"'
                             for enumeration in tagged], "}") + "\n")
    parts.append(_wrapped("STRUCTURES = {", [f'"{structure.name}": {class_name(structure.name)}'
                                                   for structure in interface.structures], "}") + "\n")
    lines = [f'    "{function.name}": ({_result_type(function.result, interface)}, '
             f"{_tuple([_argument_type(argument, interface) for argument in function.arguments])}),"
             for function in interface.functions]
    parts.append("# Result and arguments.\nFUNCTIONS = {\n" + "\n".join(lines) + "\n}\n")
    if interface.nodes:
        parts.append(_nodes_text(interface.nodes))
    if interface.passes:
        parts.append(_passes_text(interface))
    text = "\n".join(parts)
    used = sorted(set(re.findall(r"\bc_\w+\b", text)))
    return _PYTHON_HEAD + _wrapped("from ctypes import (", ["POINTER", "Structure", *used], ")") \
        + "\nfrom enum import IntEnum, IntFlag\n" + text


def _tuple(parts):
    return f"({', '.join(parts)}{',' * (len(parts) == 1)})"


def _nodes_text(nodes):
    lines = []
    for node in nodes:
        lines.append(f'    NodeType.{node.name}: ("{node.label}",')
        for slots, tail in ((node.inputs, ","), (node.outputs, "),")):
            pairs = [f'("{kind}", "{name}")' for kind, name in slots]
            lines.append(_wrapped("        (", pairs, "," * (len(pairs) == 1) + ")" + tail))
    return ("# Label, inputs and outputs of the node types: kind and name of each.\nNODES = {\n"
            + "\n".join(lines) + "\n}\n")


def _passes_text(interface):
    passes = "\n".join(f'    PassId.{entry.name}: "{entry.channels}",' for entry in interface.passes)
    ranges = "\n".join(f'    PassRange.FIRST_{entry.name}: ({entry.count}, "{entry.channels}"),'
                       for entry in interface.pass_ranges)
    return ("# Channels of the passes, a letter each.\nPASS_CHANNELS = {\n" + passes + "\n}\n\n"
            "# Passes of each range, and their channels.\nPASS_RANGES = {\n" + ranges + "\n}\n")


def _plain_constants(interface):
    """Macros and the members of enumerations without a tag."""
    constants = dict(interface.constants)
    for enumeration in interface.enumerations:
        if not enumeration.tag:
            constants.update(enumeration.members)
    return constants


def _scalar_type(base, interface):
    base = interface.typedefs.get(base, base)
    return _CTYPES[base] if base in _CTYPES else class_name(base)


def _field_type(field, interface):
    """Of a pointer: numpy gives addresses as integers, so numbers are behind a void pointer."""
    if field.pointers:
        if field.base == "char":
            return "c_char_p"
        is_structure = any(structure.name == field.base for structure in interface.structures)
        return f"POINTER({class_name(field.base)})" if is_structure else "c_void_p"
    scalar = _scalar_type(field.base, interface)
    return f"{scalar} * {field.length}" if field.length else scalar


def _argument_type(argument, interface):
    """Of a pointer to a handle or a size that the function writes: typed, so that byref() is checked."""
    if argument.pointers and argument.name.endswith("_out") and (
            argument.base in interface.typedefs or argument.base == "uint64_t"):
        return f"POINTER({_scalar_type(argument.base, interface)})"
    if argument.pointers and argument.base == "int64_t":
        return "POINTER(c_int64)"
    return _field_type(argument, interface)


def _result_type(result, interface):
    return "None" if result.base == "void" and not result.pointers else _field_type(result, interface)


def table_entries(interface):
    """[(name, C expression)], in the order of bytes of the names."""
    entries = [(name, name) for name in interface.constants]
    entries += [(name, name) for enumeration in interface.enumerations
                for name, _ in enumeration.members]
    for structure in interface.structures:
        entries.append((structure.name, f"sizeof({structure.name})"))
        entries += [(f"{structure.name}.{field.name}", f"offsetof({structure.name}, {field.name})")
                    for field in structure.fields]
    return sorted(entries)


def table_text(interface):
    """libtracer/src/api/abi_table.c."""
    lines = "\n".join(f'    {{"{name}", {expression}}},'
                      for name, expression in table_entries(interface))
    return _TABLE_HEAD + lines + "\n" + _TABLE_TAIL


_PYTHON_HEAD = '''\
# SPDX-License-Identifier: GPL-3.0-or-later
"""The binary interface of libtracer: constants, enumerations, structures, functions.

Written by libtracer/tools/generate_abi.py from libtracer/include/tracer; meanings are there. native.py
compares all values, sizes and offsets with those of the library that it loads.
"""

'''

_PYTHON_TABLES = '''
# By their names in C.
'''.rstrip("\n")

_TABLE_HEAD = '''\
/* Values, sizes and offsets of the public headers, as this compiler has them.
 * Written by libtracer/tools/generate_abi.py. */
#include "api/abi_table.h"

#include <stddef.h>

#include "tracer/tracer.h"

/* clang-format off */
const struct trc_abi_entry trc_abi_entries[] = {
'''

_TABLE_TAIL = '''\
};
/* clang-format on */

const size_t trc_abi_entry_count = sizeof trc_abi_entries / sizeof *trc_abi_entries;
'''


def generated(interface):
    """{path: text} of both files."""
    return {PYTHON: python_text(interface), TABLE: table_text(interface)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="fail if a file is not up to date")
    options = parser.parse_args()
    stale = [path for path, text in generated(read_interface()).items()
             if not path.is_file() or path.read_text() != text]
    for path in stale:
        print(f"{path.relative_to(ROOT)}: {'not up to date' if options.check else 'written'}")
        if not options.check:
            path.write_text(generated(read_interface())[path])
    return 1 if options.check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
