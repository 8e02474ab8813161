"""Nodes of a syntax tree, gone through past what holds no names."""

import ast
from pathlib import Path

import airflock
from airflock.core.law import walk_tree

LEFT_OUT = ast.expr_context, ast.operator, ast.unaryop, ast.boolop, ast.cmpop, ast.alias


def test_all_nodes_of_the_package_are_met_in_the_order_of_ast():
    for file in sorted(Path(airflock.__file__).parent.rglob("*.py")):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        assert walk_tree(tree) == [node for node in ast.walk(tree) if not isinstance(node, LEFT_OUT)], file
