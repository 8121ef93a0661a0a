"""Adds the test suites of further JUnit XML reports to a first one: merge_reports.py FIRST.xml FURTHER.xml..."""
import sys
import xml.etree.ElementTree as ElementTree


def main(first, *further):
    tree = ElementTree.parse(first)
    for path in further:
        tree.getroot().extend(ElementTree.parse(path).getroot())
    tree.write(first, encoding="utf-8", xml_declaration=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
