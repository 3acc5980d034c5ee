"""Tests of the rules of the house: layers, frame names, public names, docstrings, sizes, and the cost of imports."""

from __future__ import annotations

import ast
import importlib
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.source_trees import nodes_of, parsed

SOURCE = Path(__file__).parents[1] / "src" / "basecal"
FILES = sorted(SOURCE.rglob("*.py"))
LAYERS = [
    {"errors", "methods"},
    {"bounded_file", "box"},
    {"geometry"},
    {"numerics"},
    {"kinematics"},
    {"fields"},
    {"effects"},
    {"cell"},
    {"vision"},
    {"estimation", "exchange"},
    {"accuracy"},
    {"planning"},
    {"simulation"},
    {"acquisition"},
    {"studies", "reporting"},
    {"cli"},
]
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}
ENTRIES = {"__init__", "__main__"}


def inner_imports(tree: ast.AST, package: list[str]) -> Iterator[tuple[int, list[str]]]:
    """Line and dotted parts of each import from basecal; `package` is where relative imports start."""
    for node in nodes_of(tree):
        if isinstance(node, ast.Import):
            names = [alias.name.split(".") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            stem = [*base, *(node.module.split(".") if node.module else [])]
            names = [[*stem, alias.name] for alias in node.names]
        else:
            continue
        yield from ((node.lineno, parts) for parts in names if parts[0] == "basecal")


def imports_by_name(tree: ast.AST) -> Iterator[tuple[int, list[str]]]:
    """Line and dotted parts of each module of basecal that `import_module` loads, as far as its name is written."""
    for node in nodes_of(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module") and node.args:
            first = node.args[0].values[0] if isinstance(node.args[0], ast.JoinedStr) else node.args[0]
            text = first.value if isinstance(first, ast.Constant) and isinstance(first.value, str) else ""
            parts = text.rstrip(".").split(".")
            yield from [(node.lineno, parts)] if parts[0] == "basecal" else []


def layer_faults(tree: ast.AST, parts: tuple[str, ...]) -> list[str]:
    """What is wrong with the imports of the module at `parts`, such as ("cell", "target")."""
    mine, faults = parts[0], []
    if mine not in LEVEL:
        return [f"{mine} is not a known package: give it a layer"]
    for line, imported in (*inner_imports(tree, ["basecal", *parts[:-1]]), *imports_by_name(tree)):
        theirs = imported[1] if len(imported) > 1 else ""
        if theirs not in LEVEL:
            faults.append(f"line {line}: {'.'.join(imported)} goes through the root or to an unknown package")
        elif theirs != mine and LEVEL[theirs] >= LEVEL[mine]:
            faults.append(f"line {line}: {mine} imports {theirs}, which is not below it")
    return faults


def module_parts(path: Path) -> tuple[str, ...]:
    return path.relative_to(SOURCE).with_suffix("").parts


def everywhere(faults_of: Callable[[Path], Collection[object]]) -> dict[str, Collection[object]]:
    """Faults by file, for files with faults."""
    found = {str(path.relative_to(SOURCE)): faults_of(path) for path in FILES}
    return {name: faults for name, faults in found.items() if faults}


def test_imports_point_down() -> None:
    """Every import inside the package points to a lower layer or stays in its own package."""
    inner = {path for path in FILES if module_parts(path)[0] not in ENTRIES}
    assert everywhere(lambda path: layer_faults(parsed(path), module_parts(path)) if path in inner else []) == {}


ROOM_SIZE = 14
LISTS_OF_LIKE_THINGS = {"cli", "exchange"}  # so is each room with a registry, to which anyone may add


def room_of(parts: tuple[str, ...]) -> str:
    """Room of a module: its folder within a package, or the module if it is at the package's root."""
    return "/".join(parts[:2])


def room_imports() -> dict[str, set[str]]:
    """Rooms of the same package that each room imports from."""
    edges: dict[str, set[str]] = {}
    for path in FILES:
        parts = module_parts(path)
        for _, imported in inner_imports(parsed(path), ["basecal", *parts[:-1]]):
            if len(parts) > 1 and len(imported) > 2 and imported[1] == parts[0]:
                here, there = room_of(parts), room_of(tuple(imported[1:]))
                edges.setdefault(here, set()).update({there} - {here})
    return edges


def circle(edges: dict[str, set[str]]) -> list[str]:
    """One circle of rooms that import one another; empty if there is none."""
    waiting = dict(edges)
    while leaves := [room for room, imports in waiting.items() if not imports & waiting.keys()]:
        for room in leaves:
            del waiting[room]
    return sorted(waiting)


def test_rooms_of_a_package_have_no_import_circle() -> None:
    """The rooms of a package have an order in which every import points down."""
    assert circle(room_imports()) == []


def test_circle_check_finds_violations() -> None:
    """Two rooms that import each other are found; their other imports are not listed."""
    assert circle({"a": {"b", "c"}, "b": {"a"}, "c": set()}) == ["a", "b"]


def crowded_rooms(paths: Collection[Path]) -> list[str]:
    """Folders with more than fourteen modules that are no lists of equal kinds."""
    modules = [path for path in paths if path.stem not in ENTRIES]
    lists = LISTS_OF_LIKE_THINGS | {str(path.parent) for path in modules if path.stem == "registry"}
    counts = Counter(str(path.parent) for path in modules)
    return [folder for folder, count in counts.items() if count > ROOM_SIZE and folder not in lists]


def test_rooms_are_small() -> None:
    """No folder has more than fourteen modules, except lists of equal kinds."""
    assert crowded_rooms([path.relative_to(SOURCE) for path in FILES]) == []


def test_room_check_finds_violations() -> None:
    """Fifteen modules are too many, but not in a room with a registry, whose kinds anyone may add to."""
    modules = [Path("cell", "targets", f"kind_{k}.py") for k in range(15)]
    assert crowded_rooms(modules) == ["cell/targets"]
    assert crowded_rooms([*modules, Path("cell", "targets", "registry.py")]) == []


@pytest.mark.parametrize(
    ("source", "parts"),
    [
        ("from basecal import read_cell", ("cell", "files")),
        ("import basecal", ("cli", "new")),
        ("from basecal.cli.new import new", ("reporting", "text")),
        ("def f():\n    from basecal.estimation import solve", ("exchange", "poses")),
        ("from ..accuracy import verdict", ("estimation", "solve")),
        ("from basecal.gossip import x", ("cli", "new")),
        ("getattr(import_module('basecal'), name)", ("cell", "calibration")),
        ("importlib.import_module(f'basecal.reporting.{name}')", ("cell", "calibration")),
        ("", ("gossip", "x")),
    ],
)
def test_layer_check_finds_violations(source: str, parts: tuple[str, ...]) -> None:
    """An upward, sideways, rooted or unknown import is found anywhere in a file."""
    assert layer_faults(ast.parse(source), parts)


FRAMES = re.compile(r"^_?(?:(?:measured|recorded|true)_)?(?P<target>[a-z0-9_]+?)_from_(?P<source>[a-z0-9_]+)$")
POINT = re.compile(r"^\w+?_in_(?P<frame>[a-z0-9_]+)$")
NO_FRAMES = {
    *("matrix", "rotation", "quaternion", "rotvec", "rpy", "dict", "streams", "text", "line", "file"),
    *("archive", "csv", "normal", "parts", "lines", "candidates"),
}


@cache
def frames_of_name(name: str) -> tuple[str, str] | None:
    """(a, b) of `a_from_b`, (a, "") of `p_in_a`, None of any other name."""
    if (found := FRAMES.match(name)) and found["source"] not in NO_FRAMES:
        return found["target"], found["source"]
    if found is None and (found := POINT.match(name)):
        return found["frame"], ""
    return None


class FrameChecker:
    """Checker of names `a_from_b` in products, inverses, assignments and returns."""

    def __init__(self) -> None:
        self.faults: set[str] = set()
        self.checked = 0

    def frames(self, node: ast.AST) -> tuple[str, str] | None:
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name):
                return frames_of_name(name)
            case ast.Subscript(value=value):
                return self.frames(value)
            case ast.Call(func=ast.Attribute(value=value, attr="inverse")):
                inner = self.frames(value)
                return (inner[1], inner[0]) if inner and inner[1] else None
            case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
                called = frames_of_name(name)
                return called if called and called[1] else None
            case ast.BinOp(left=left, op=ast.MatMult(), right=right):
                return self.product(node, self.frames(left), self.frames(right))
        return None

    def product(
        self, node: ast.AST, left: tuple[str, str] | None, right: tuple[str, str] | None
    ) -> tuple[str, str] | None:
        if not left or not right or not left[1]:
            return None
        self.expect(node, left[1], right[0])
        return left[0], right[1]

    def expect(self, node: ast.AST, want: object, got: object) -> None:
        self.checked += 1
        if want != got:
            self.faults.add(f"line {node.lineno}: {want} is not {got}: {ast.unparse(node)}")

    def agree(self, name: str, value: ast.AST) -> None:
        want, got = frames_of_name(name), self.frames(value)
        if want and got:
            self.expect(value, want, got)

    def check(self, node: ast.AST) -> None:
        match node:
            case ast.Assign(targets=targets, value=value):
                for target in targets:
                    if isinstance(target, ast.Name | ast.Attribute):
                        self.agree(target.id if isinstance(target, ast.Name) else target.attr, value)
            case ast.keyword(arg=str(name), value=value):
                self.agree(name, value)
            case ast.FunctionDef(name=name) if frames_of_name(name):
                for each in ast.walk(node):
                    if isinstance(each, ast.Return) and each.value is not None:
                        self.agree(name, each.value)
            case ast.BinOp():
                self.frames(node)


@cache
def frame_check(tree: ast.AST) -> FrameChecker:
    checker = FrameChecker()
    for node in nodes_of(tree):
        checker.check(node)
    return checker


def test_frame_names_agree() -> None:
    """A name `a_from_b` agrees with its algebra: inner frames are equal, and inverses exchange the frames."""
    assert everywhere(lambda path: frame_check(parsed(path)).faults) == {}


def test_frame_check_finds_products() -> None:
    """The check of frame names finds products to check."""
    assert sum(frame_check(parsed(path)).checked for path in FILES) > 5


@pytest.mark.parametrize(
    "source",
    [
        "a_from_c = a_from_b @ c_from_b",
        "b_from_a = a_from_b",
        "solve(eye_from_hand=eye_from_hand.inverse())",
        "p_in_a = b_from_a @ p_in_a",
        "def a_from_b(x):\n    return x.b_from_a",
        "x = a_from_b @ p_in_a",
    ],
)
def test_frame_check_finds_violations(source: str) -> None:
    """A product, inverse, argument or return with wrong frames is found."""
    assert frame_check(ast.parse(source)).faults


def test_frame_check_accepts_the_equation() -> None:
    """The equation of the paper passes, and each of its products is checked."""
    source = """camera_from_target = (eye_base_from_eye_flange @ eye_flange_from_camera).inverse() @ (
        eye_base_from_hand_base @ hand_base_from_hand_flange @ hand_flange_from_target)"""
    checker = frame_check(ast.parse(source))
    assert checker.faults == set()
    assert checker.checked >= 5


def public_definitions(tree: ast.Module) -> Iterator[ast.FunctionDef | ast.ClassDef]:
    """Functions and classes of a module without a leading underscore, and such methods of such classes."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node
            if isinstance(node, ast.ClassDef):
                yield from (
                    each for each in node.body if isinstance(each, ast.FunctionDef) and not each.name.startswith("_")
                )


def is_overload(node: ast.FunctionDef | ast.ClassDef) -> bool:
    return any(ast.unparse(decorator) == "overload" for decorator in node.decorator_list)


def undocumented(path: Path) -> list[str]:
    tree = parsed(path)
    bare = [node.name for node in public_definitions(tree) if not ast.get_docstring(node) and not is_overload(node)]
    return bare if ast.get_docstring(tree) else ["the module", *bare]


NO_NOUNS = {"of", "what", "at"}


def test_parameters_are_nouns() -> None:
    """No parameter is a preposition or a pronoun."""

    def named(path: Path) -> list[str]:
        functions = [node for node in nodes_of(parsed(path)) if isinstance(node, ast.FunctionDef)]
        return [f.name for f in functions if NO_NOUNS & {a.arg for a in (*f.args.posonlyargs, *f.args.args)}]

    assert everywhere(named) == {}


def test_public_names_have_docstrings() -> None:
    """Each module, public class and public function has a docstring."""
    assert everywhere(undocumented) == {}


def promised_nones(path: Path) -> list[str]:
    """Functions whose docstring promises None, and whose annotation does not have it."""
    functions = [node for node in nodes_of(parsed(path)) if isinstance(node, ast.FunctionDef) and node.returns]
    promised = [
        f for f in functions if re.search(r"; None (if|where)", (ast.get_docstring(f) or "").partition("\n")[0])
    ]
    return [f.name for f in promised if "None" not in ast.unparse(f.returns or f)]


def test_promised_none_is_in_the_return_type() -> None:
    """A function whose first line ends with `None if` can return None."""
    assert everywhere(promised_nones) == {}


def too_long(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8")
    functions = [node for node in nodes_of(parsed(path)) if isinstance(node, ast.FunctionDef)]
    long = [f"{node.name}: {own_lines(node)}" for node in functions if own_lines(node) > 40]
    return [f"file: {lines}", *long] if (lines := len(text.splitlines())) >= 400 else long


def test_files_and_functions_are_short() -> None:
    """No file reaches 400 lines, and no function has more than 40 besides its docstring."""
    assert everywhere(too_long) == {}


def own_lines(node: ast.FunctionDef) -> int:
    """Lines of a function without its docstring."""
    said = node.body[0] if ast.get_docstring(node) else None
    doc = 0 if said is None else (said.end_lineno or 0) - said.lineno + 1
    return (node.end_lineno or 0) - node.lineno + 1 - doc


def package_names() -> list[str]:
    return ["basecal", *sorted(f"basecal.{path.parent.name}" for path in SOURCE.glob("*/__init__.py"))]


@pytest.mark.parametrize("name", package_names())
def test_all_lists_are_correct(name: str) -> None:
    """Each name in `__all__` exists, once."""
    module = importlib.import_module(name)
    listed = list(getattr(module, "__all__", []))
    assert len(set(listed)) == len(listed)
    assert [each for each in listed if not hasattr(module, each)] == []


def test_public_table_matches_its_types() -> None:
    """The lazy table and the imports for type checkers name the same things from the same modules."""
    import basecal

    block = next(node for node in parsed(SOURCE / "__init__.py").body if isinstance(node, ast.If))
    typed = {
        alias.name: node.module.removeprefix("basecal.")
        for node in block.body
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    assert typed == basecal._HOME
    assert all(dir(basecal).count(name) == 1 for name in typed)


def test_unknown_public_name() -> None:
    """A name that is not public is an AttributeError that names it."""
    import basecal

    with pytest.raises(AttributeError, match="calibrat_"):
        _ = basecal.calibrat_


def loaded_by(code: str) -> set[str]:
    """Modules that a fresh interpreter has after `code`."""
    program = f"{code}\nimport sys\nprint(*sys.modules)"
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(ended.stdout.splitlines()[-1].split())


def test_import_is_light() -> None:
    """`import basecal` loads no heavy module, not even NumPy."""
    assert loaded_by("import basecal").isdisjoint({"numpy", "scipy", "cv2", "mujoco", "pydantic", "ruamel", "rich"})


def test_help_is_light() -> None:
    """The help of the command line and of each verb loads no numerical library."""
    help_of = "from basecal.cli import main\nmain(['--help']); main(['calibrate', '--help'])"
    assert loaded_by(help_of).isdisjoint({"numpy", "scipy", "cv2", "mujoco", "pydantic", "ruamel"})


def test_calibrate_loads_neither_images_nor_devices(tmp_path: Path) -> None:
    """A simulated cell, and a recording with pixels, its report and page, need no OpenCV, drivers or distributions."""
    cell = shutil.copytree(SOURCE.parents[1] / "examples/ur5e_dual", tmp_path / "cell", ignore=lambda *_: {"runs"})
    loaded = loaded_by(
        f"import basecal\nbasecal.simulate\nfrom basecal.cli import main\nmain(['calibrate', {str(cell)!r}])"
    )
    assert {"basecal.accuracy.calibrate", "basecal.reporting.page", "basecal.simulation"} <= loaded
    others = {"cv2", "mujoco", "pin", "gtsam", "pyceres", "rich", "scipy.ndimage", "scipy.spatial", "scipy.stats"}
    assert loaded.isdisjoint({*others, "basecal.acquisition", "basecal.vision"})


def test_hulls_are_loaded_only_for_drawn_surfaces() -> None:
    """Each page imports the surfaces, but few cells have bodies."""
    assert "scipy.spatial" not in loaded_by("import basecal.kinematics.surface")


def test_constraints_have_no_addresses() -> None:
    """The constraints pin versions without addresses of package indices."""
    lines = (SOURCE.parents[1] / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9_.-]+==[A-Za-z0-9_.+!-]+", pin) for pin in pins)
    assert len(pins) > 30


TESTS = Path(__file__).parent
OF_BENCHMARKS = {"test_reference.py", "test_benchmarks.py", "test_peers.py"}


def test_only_tests_of_benchmarks_import_them() -> None:
    """Code for both is in `tests/shared`."""
    sources = {path.name: path.read_text(encoding="utf-8") for path in TESTS.rglob("*.py")}
    importing = {name for name, text in sources.items() if re.search(r"^\s*(from|import) benchmarks\b", text, re.M)}
    assert importing == OF_BENCHMARKS


MIRRORED = (
    "geometry",
    "numerics",
    "kinematics",
    "fields",
    "effects",
    "cell",
    "vision",
    "estimation",
    "exchange",
    "accuracy",
    "simulation",
    "studies",
    "planning",
    "acquisition",
    "reporting",
    "cli",
)
NOTHING_TO_TEST = {
    "cell/files.py": "names of other modules",
    "accuracy/findings/evidence.py": "values without behaviour",
    "acquisition/supervision/limits.py": "times, which the trials of tests/safety hold",
}


def test_every_source_has_tests_under_its_own_name() -> None:
    """`src/basecal/cell/cell.py` is tested by `tests/cell/test_cell.py`; a few exceptions have reasons.

    Tables of kinds, each a `registry.py`, are tested by `tests/test_registry.py`.
    """
    sources = [path.relative_to(SOURCE) for path in FILES if path.stem not in {*ENTRIES, "registry"}]
    held = [path for path in sources if path.parts[0] in MIRRORED]
    bare = {str(path) for path in held if not (TESTS / path.parent / f"test_{path.name}").exists()}
    missing = [f"tests/{path.parent}/test_{path.name}" for path in held if str(path) in bare - NOTHING_TO_TEST.keys()]
    assert not missing, f"write a test of what the module promises: {', '.join(missing)}"
    assert not NOTHING_TO_TEST.keys() - bare, f"tested, or gone: {sorted(NOTHING_TO_TEST.keys() - bare)}"


DECOMPOSITIONS = {"svd", "eig", "eigh", "eigvals", "eigvalsh", "pinv", "pinvh", "lstsq", "matrix_rank", "cond"}
DECIDES_NOTHING = {
    "accuracy/scene/checks.py": "a largest variance",
    "estimation/scene/spread.py": "roots of covariances",
    "accuracy/task/expected_error.py": "variances, of which zero is as good as any",
    "geometry/lens.py": "the roots of a polynomial",
    "geometry/rotation.py": "the rotation nearest to a matrix",
    "estimation/certificate/relaxation.py": "smallest eigenvalues, which are the bound itself",
    "estimation/certificate/view_rotation.py": "the rotation nearest to a matrix, and a curvature's least eigenvalue",
    "reporting/cell_view/picture.py": "a line drawn",
    "reporting/cell_view/scene.py": "an ellipsoid drawn",
    "vision/fit/local_map.py": "the vector that rows map nearest to zero",
    "vision/kinds/circles.py": "a root of a matrix",
}


def decompositions(tree: ast.AST) -> list[str]:
    """Lines that decompose a matrix by the linear algebra of NumPy or SciPy."""
    found = []
    for node in nodes_of(tree):
        if isinstance(node, ast.Attribute) and node.attr in DECOMPOSITIONS:
            found.append(f"line {node.lineno}: {ast.unparse(node)}")
        elif isinstance(node, ast.ImportFrom) and (node.module or "").endswith("linalg"):
            found += [f"line {node.lineno}: {alias.name}" for alias in node.names if alias.name in DECOMPOSITIONS]
    return found


def test_one_module_decides_rank_gap_and_pseudo_inverse() -> None:
    """Matrices are decomposed in `numerics/spectral`, and elsewhere only if no threshold divides the result."""
    found = everywhere(lambda path: decompositions(parsed(path)))
    assert found.keys() == {"numerics/spectral.py", *DECIDES_NOTHING}


def test_decomposition_check_finds_violations() -> None:
    """Calls and imports of NumPy's and SciPy's decompositions are found; solving and inverting are allowed."""
    code = "from scipy.linalg import eigh as e, solve\nnp.linalg.pinv(m)\nnp.linalg.inv(m)\nlinalg.matrix_rank(m)"
    assert decompositions(ast.parse(code)) == ["line 1: eigh", "line 2: np.linalg.pinv", "line 4: linalg.matrix_rank"]
