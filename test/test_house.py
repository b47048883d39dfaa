# SPDX-License-Identifier: Apache-2.0
"""The house rules that a program can check; CONTRIBUTING lists all of them."""

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

import socialcircle_ros

PACKAGE = Path(socialcircle_ros.__file__).parent
ROOT = PACKAGE.parent

MOST_LINES_OF_A_MODULE = 450
MOST_LINES_OF_A_FUNCTION = 80
MOST_EXPLICIT_ANY = 3


@cache  # each test process collects these tests; one of them reads the package
def trees():
    return {
        path.relative_to(PACKAGE): ast.parse(path.read_text(encoding='utf-8')) for path in PACKAGE.rglob('*.py')
    }


def functions(tree):
    return [node for node in ast.walk(tree) if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]


def is_kernel(function):
    return any(isinstance(each, ast.Name) and each.id == 'kernel' for each in function.decorator_list)


def is_any(node):
    return (isinstance(node, ast.Name) and node.id == 'Any') or (
        isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and re.search(r'\bAny\b', node.value) is not None
    )


def annotations(function):
    arguments = function.args
    every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg]
    return [each.annotation for each in every if each is not None and each.annotation] + (
        [function.returns] if function.returns else []
    )


def uses_any(annotation):
    """Whether an annotation holds Any, other than as the shape of a NumPy array."""
    return any(is_any(node) for node in ast.walk(annotation))


def test_no_module_is_too_long():
    lines = {path: len((PACKAGE / path).read_text(encoding='utf-8').splitlines()) for path in trees()}
    assert not {str(path): count for path, count in lines.items() if count > MOST_LINES_OF_A_MODULE}


def test_no_function_but_a_kernel_is_too_long():
    long = [
        f'{path}: {function.name}'
        for path, tree in trees().items()
        for function in functions(tree)
        if function.end_lineno - function.lineno + 1 > MOST_LINES_OF_A_FUNCTION and not is_kernel(function)
    ]
    assert not long


def public_functions(tree):
    """Functions and methods that other modules may call: no name on the way to them begins with `_`."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith('_'):
            yield node
        elif isinstance(node, ast.ClassDef) and not node.name.startswith('_'):
            for method in node.body:
                if isinstance(method, ast.FunctionDef) and (
                    not method.name.startswith('_') or method.name == '__init__'
                ):
                    yield method


def test_no_public_signature_holds_any():
    loose = [
        f'{path}: {function.name}'
        for path, tree in trees().items()
        for function in public_functions(tree)
        if any(uses_any(annotation) for annotation in annotations(function))
    ]
    assert not loose


def test_any_is_rare():
    found = [node for tree in trees().values() for node in ast.walk(tree) if is_any(node)]
    assert len(found) <= MOST_EXPLICIT_ANY


def names_of_types(tree):
    """Classes and type aliases of a module."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            yield node.name.strip('_')
        elif isinstance(node, ast.Assign) and isinstance(node.value, (ast.Subscript, ast.BinOp)):
            for target in node.targets:
                if isinstance(target, ast.Name) and re.fullmatch(r'_?[A-Z][a-z\d]+([A-Z][a-z\d]*)*', target.id):
                    yield target.id.strip('_')


def test_one_name_has_one_meaning():
    rooms = defaultdict(list)
    for path, tree in trees().items():
        for name in names_of_types(tree):
            rooms[name].append(str(path))
    assert not {name: paths for name, paths in rooms.items() if len(paths) > 1}


def names_in(node, but='Callable'):
    """The names in an expression, those in text of annotations too; without what is in a `but[...]`."""
    if isinstance(node, ast.Subscript) and but in names_in(node.value):
        return set()
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return set(re.findall(r'\w+', node.value))
    own = {node.id} if isinstance(node, ast.Name) else {node.attr} if isinstance(node, ast.Attribute) else set()
    return own.union(*(names_in(child, but) for child in ast.iter_child_nodes(node)))


def aliases_of(node):
    """The names that a statement gives, and the expression that they stand for: also of `X: TypeAlias = ...`."""
    if isinstance(node, ast.AnnAssign):
        targets = [node.target] if 'TypeAlias' in names_in(node.annotation) else []
    else:
        targets = node.targets if isinstance(node, ast.Assign) else []
    return [(target.id, node.value) for target in targets if isinstance(target, ast.Name)]


def names_of_arrays():
    """NDArray, and the aliases that hold one."""
    found = {'NDArray'}
    aliases = [alias for tree in trees().values() for node in tree.body for alias in aliases_of(node)]
    while True:
        more = {
            name
            for name, value in aliases
            if names_in(value) & found and isinstance(value, (ast.Subscript, ast.BinOp))
        }
        if more <= found:
            return found
        found |= more


def fields_of(type_):
    """The annotations of the fields of a class."""
    return [field.annotation for field in type_.body if isinstance(field, ast.AnnAssign)]


def compares_fields(type_):
    """Whether == of two objects compares their fields."""
    decorators = [text for text in map(ast.unparse, type_.decorator_list) if re.search(r'\bdataclass\b', text)]
    return is_named_tuple(type_) or any('eq=False' not in text for text in decorators)


def is_named_tuple(type_):
    return 'NamedTuple' in {ast.unparse(base) for base in type_.bases}


def closure(names, more_of):
    """The names and those that `more_of` finds with them, again and again."""
    while not (more := more_of(names)) <= names:
        names = names | more
    return names


def test_types_with_arrays_are_compared_by_identity():
    """The == of a tuple or of its fields is refused by arrays, and so is its hash.

    Arguments of kernels must be tuples; kernels alone take them, and nobody compares them.
    """
    arrays = names_of_arrays()
    assert {'Mask', 'Cloud', 'Floats', 'PitchLike'} <= arrays
    types = [node for tree in trees().values() for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    kernels = [each for tree in trees().values() for each in functions(tree) if is_kernel(each)]
    taken = {name for kernel in kernels for annotation in annotations(kernel) for name in names_in(annotation)}
    taken = closure(
        taken,
        lambda names: {
            name for type_ in types if type_.name in names for each in fields_of(type_) for name in names_in(each)
        },
    )
    holding = closure(
        arrays,
        lambda names: {
            type_.name
            for type_ in types
            if compares_fields(type_) and any(names_in(each) & names for each in fields_of(type_))
        },
    )
    assert 'Holes' in taken & holding
    assert not {
        type_.name
        for type_ in types
        if type_.name in holding and not (is_named_tuple(type_) and type_.name in taken)
    }


def test_cores_are_those_that_the_process_may_use():
    assert not [str(path) for path in trees() if 'cpu_count' in (PACKAGE / path).read_text(encoding='utf-8')]


def test_commands_draw_on_the_console_that_knows_the_foreground():
    """Rich's own Console, and click's bar, draw over the prompt of a shell when they run in its background."""
    drawing = re.compile(r'\b(Console|Progress|progressbar)\(')
    own = [path for path in trees() if path != Path('commands/console.py')]
    assert not [str(path) for path in own if drawing.search((PACKAGE / path).read_text(encoding='utf-8'))]


TOPICS = re.compile(
    r"'(?!/truth/)[^' ]*\b(outlier_mask|outlier_score|points_filtered|points_repaired|stack/\w+|last_points)'"
)


def test_topics_are_named_in_the_interface_only():
    named = [str(path) for path in trees() if TOPICS.search((PACKAGE / path).read_text(encoding='utf-8'))]
    assert named == ['interface.py']


def test_kernels_use_nothing_that_the_oldest_numba_lacks():
    """Numba 0.58 compiles no `float('inf')`: np.inf is the same."""
    found = [
        f'{path}: {function.name}: {ast.unparse(node)}'
        for path, tree in trees().items()
        for function in functions(tree)
        if is_kernel(function)
        for node in ast.walk(function)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == 'float'
        and isinstance(node.args[0], ast.Constant)
        and isinstance(node.args[0].value, str)
    ]
    assert not found


def test_every_module_names_its_licence():
    files = [path for path in ROOT.rglob('*.py') if not {'build', 'install'} & set(path.relative_to(ROOT).parts)]
    own = [path for path in files if not any(part.startswith('.') for part in path.relative_to(ROOT).parts)]
    lines = {path: path.read_text(encoding='utf-8').splitlines()[:2] for path in own}
    assert not [path for path, first in lines.items() if '# SPDX-License-Identifier: Apache-2.0' not in first]
