#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures of a source tree's structure, for side-by-side comparison with other projects.

    python3 tests/structure.py [TREE] [--public FOLDER] [--kernels FOLDER]

TREE is any C, C++ or Python project (default: this one); --public: the folder of its public headers,
--kernels: of its inner loops, both below TREE. Tests, benchmarks, builds and third parties are left out.

Sources are read as text: a function is a brace after a parameter list; a field or function is documented by
a comment in its line or just above it, or above the block of lines without blanks that it stands in; a bare
number is a literal in a function that is neither of PLAIN nor a constant's initializer.
"""

import argparse
import ast
import re
import statistics
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LEFT_OUT = {"tests", "test", "bench", "benchmark", "build", "extern", "third_party", "ext", "examples", "docs",
            "tools", "samples", "demo", ".git", ".library"}
C_ENDINGS = {".c", ".h", ".cpp", ".cc", ".cxx", ".hpp"}
PLAIN = {"0", "1", "2", "3", "4", "8", "16", "32", "64", "0.0", "0.5", "1.0", "2.0", "0xff", "255"}
CONTROL = {"if", "for", "while", "switch", "return", "sizeof", "else", "do", "catch"}
# Tables that a script wrote and nobody reads, by the words of their first comment.
GENERATED = re.compile(r"\b(written|generated|made) by [\w/]+\.py", re.I)


def sources(tree, endings):
    """The files of a tree that count."""
    return sorted(path for path in tree.rglob("*") if path.suffix in endings and path.is_file()
                  and not LEFT_OUT & {part.lower() for part in path.relative_to(tree).parts[:-1]}
                  and not any(part.startswith("build") for part in path.relative_to(tree).parts[:-1]))


def without_comments(text):
    """Text with comments and the insides of strings blanked, line by line as before."""
    def blank(match):
        kept = match[0][0] + match[0][-1] if match[0][0] in "\"'" else ""
        return kept + "\n" * match[0].count("\n")
    return re.sub(r'"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\'|/\*.*?\*/|//[^\n]*', blank, text, flags=re.S)


def functions_of(code):
    """(first line, last line) of each function's body in a text without comments."""
    code = re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", lambda m: "\n" * m[0].count("\n"), code, flags=re.M)
    found, depth, inside, line, head = [], 0, None, 1, ""
    for letter in code:
        if letter == "\n":
            line += 1
        if letter == "{":
            if inside is None and re.search(r"\)\s*(const|noexcept|override|final|\w+_\w+|\s|:[^;]*)*$", head):
                name = re.search(r"([\w~]+)\s*\(", head.strip())
                if name and name[1] not in CONTROL and "=" not in head.split("(")[0]:
                    inside = depth, line
            depth += 1
            head = ""
        elif letter == "}":
            depth -= 1
            if inside is not None and depth == inside[0]:
                found.append((inside[1], line))
                inside = None
            head = ""
        elif letter == ";":
            head = ""
        else:
            head += letter
    return found


def python_functions(text):
    """(first line, last line) of each function."""
    return [(node.lineno, node.end_lineno) for node in ast.walk(ast.parse(text))
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]


def documented(text):
    """Fields and functions of a public header: (documented fields, fields, documented functions, functions)."""
    fields, functions, in_struct, above, in_comment = [], [], False, False, False
    statement, statement_comment = "", False
    for line in text.split("\n"):
        code = re.sub(r"/\*.*?\*/|//.*$", "", line)
        has_comment = in_comment or "/*" in line or "//" in line
        if in_comment:
            code = line.split("*/", 1)[1] if "*/" in line else ""
        elif "/*" in code:
            code = code.split("/*", 1)[0]
        in_comment = line.rfind("/*") > line.rfind("*/") or (in_comment and "*/" not in line)
        code = code.strip()
        if not code:
            if has_comment and statement == "":
                above = True
                if in_struct and fields and not line.strip().startswith("/*"):
                    fields[-1] = True  # a field's comment that goes on
            elif not line.strip():
                above = False
            continue
        if code.startswith("#"):
            continue
        if re.search(r"\b(struct|union)\b[^;()]*{$", code):
            in_struct, above, statement = True, False, ""
            continue
        if in_struct and code.startswith("}"):
            in_struct, above, statement = False, False, ""
            continue
        statement, statement_comment = f"{statement} {code}".strip(), statement_comment or has_comment
        if not code.endswith((";", "}", "{")):
            continue
        if in_struct and statement.endswith(";"):
            fields.append(above or statement_comment)
        elif re.search(r"\w\s*\([^;]*\)\s*;$", statement) and not statement.startswith(("typedef", "enum")):
            functions.append(above or statement_comment)
        statement, statement_comment = "", False
    return sum(fields), len(fields), sum(functions), len(functions)


def comment_lines(text):
    """Lines that are comments in whole or in part."""
    spans = re.finditer(r'"(?:[^"\\\n]|\\.)*"|(/\*.*?\*/|//[^\n]*)', text, flags=re.S)
    return len({text.count("\n", 0, match.start()) + i for match in spans if match[1]
                for i in range(match[0].count("\n") + 1)})


def bare_numbers(code):
    """Literals in functions that say nothing by themselves."""
    lines, count = code.split("\n"), 0
    for first, last in functions_of(code):
        for line in lines[first - 1:last]:
            if re.match(r"\s*(#|static const|const |enum|case )", line):
                continue
            for literal in re.findall(r"(?<![\w.])(0x[\da-fA-F]+|\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+)(?=[fFuUlL]*\b)",
                                      line):
                count += literal.rstrip(".") not in PLAIN
    return count


def spread(lengths):
    """Median, nine tenths and maximum."""
    if not lengths:
        return "none"
    ordered = sorted(lengths)
    return f"{statistics.median(ordered):.0f} / {ordered[int(0.9 * (len(ordered) - 1))]} / {ordered[-1]}"


def share(part, whole):
    """A share in per cent."""
    return f"{100.0 * part / whole:.0f} % of {whole}" if whole else "none"


def measures(tree, public, kernels):
    """[(measure, value)]"""
    files = {path: path.read_text(errors="replace") for path in sources(tree, C_ENDINGS)}
    files = {path: text for path, text in files.items() if not GENERATED.search(text[:400])}
    code = {path: without_comments(text) for path, text in files.items()}
    rows = [("C and C++: files, lines", f"{len(files)}, {sum(text.count(chr(10)) for text in files.values())}"),
            ("function lines, median / p90 / max",
             spread([last - first + 1 for text in code.values() for first, last in functions_of(text)]))]
    python = [path.read_text() for path in sources(tree, {".py"})]
    python = [text for text in python if not re.search(r"^(?:#.*\n)*\"\"\"[^\"]*\bWritten by", text)]
    if python:
        rows.append(("Python function lines, median / p90 / max", spread(
            [last - first + 1 for text in python for first, last in python_functions(text)])))
    counts = [documented(text) for path, text in files.items() if public in path.parents]
    if counts:
        fields, all_fields, functions, all_functions = map(sum, zip(*counts))
        rows += [("public fields documented", share(fields, all_fields)),
                 ("public functions documented", share(functions, all_functions))]
    filled = sum(1 for text in files.values() for line in text.split("\n") if line.strip())
    rows.append(("comment lines", share(sum(map(comment_lines, files.values())), filled)))
    macros = sum(len(re.findall(r"^[ \t]*#[ \t]*define\b", text, flags=re.M)) for text in code.values())
    rows.append(("macros per 1,000 lines", f"{1000.0 * macros / filled:.1f}"))
    inner = [text for path, text in code.items() if kernels in path.parents]
    if inner:
        lines = sum(text.count("\n") for text in inner)
        rows.append(("bare numbers per 1,000 lines of kernels",
                     f"{1000.0 * sum(map(bare_numbers, inner)) / lines:.1f}"))
    folders = Counter(path.parent.relative_to(tree).as_posix() for path in files)
    folder, most = folders.most_common(1)[0]
    rows.append(("files in the largest folder, folders", f"{most} ({folder}), {len(folders)}"))
    included = Counter(Path(name).name for text in files.values()
                       for name in set(re.findall(r'^[ \t]*#[ \t]*include[ \t]+["<]([^">]+)', text, flags=re.M)))
    single = [path for path in files if path.suffix in {".h", ".hpp"} and public not in path.parents
              and included[path.name] == 1]
    rows.append(("headers with a single includer, lines",
                 f"{len(single)}, {sum(files[path].count(chr(10)) for path in single)}"))
    rows.append(("files above 500 lines", str(sum(text.count("\n") > 500 for text in files.values())
                                              + sum(text.count("\n") > 500 for text in python))))
    return rows, single


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tree", nargs="?", type=Path, default=ROOT)
    parser.add_argument("--public", default="libtracer/include")
    parser.add_argument("--kernels", default="libtracer/src/kernels")
    parser.add_argument("--list", action="store_true", help="name the headers with a single includer")
    options = parser.parse_args()
    tree = options.tree.resolve()
    rows, single = measures(tree, tree / options.public, tree / options.kernels)
    for name, value in rows:
        print(f"{name:44} {value}")
    for path in single if options.list else ():
        print(f"  {path.relative_to(tree)}")


if __name__ == "__main__":
    main()
