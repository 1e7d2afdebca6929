"""Promises of the pages about the tree: names on them exist, and folders and parts are named on them."""

import ast
import io
import re
import tokenize
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

from site_search import on_page_markdown

ROOT = Path(__file__).parents[1]
GLOSSARY = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
FOLDERS = ["rcopterx", *sorted(path.name for path in (ROOT / "rcopterx").iterdir() if path.is_symlink())]
"""Folders of the product; those beside `rcopterx` are packages in it by symbolic links."""
ROWS = re.findall(r"^\| ([^|]+) \|[^|]+\|[^|]*\| `([^`]+)`(?: `([^`]+)`)? \|$", GLOSSARY, re.MULTILINE)


def test_every_row_of_the_glossary_names_where_its_term_is_defined() -> None:
    rows = [line for line in GLOSSARY.splitlines() if line.startswith("| ")]
    headings = sum(line.startswith(("| term ", "| --- ")) for line in rows)
    assert len(ROWS) == len(rows) - headings > 40


@pytest.mark.parametrize(("term", "path", "name"), ROWS, ids=[row[0] for row in ROWS])
def test_a_term_is_defined_where_the_glossary_says(term: str, path: str, name: str) -> None:
    source = (ROOT / path).read_text(encoding="utf-8")
    assert not name or re.search(rf"^(class|def) {name}\b|^{name}\b.*=", source, re.MULTILINE)


def test_no_term_is_explained_twice() -> None:
    terms = [term for term, _, _ in ROWS]
    assert len(set(terms)) == len(terms)


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`([a-z_]+/[a-z_/]*(?:\.py)?)`", ARCHITECTURE))))
def test_what_the_architecture_names_is_there(path: str) -> None:
    folders = (ROOT, ROOT / "agents", ROOT / "studies" / "rcopterx_studies")
    assert any((folder / path).exists() for folder in folders)


def rows_of(table: str) -> dict[str, str]:
    """Second cells by the names of the first ones, of the table whose first heading this is."""
    body = ARCHITECTURE.split(f"| {table} |", 1)[1].split("\n\n", 1)[0]
    cells = [line.strip("| ").split(" | ") for line in body.splitlines()[2:]]
    return {name.strip("/"): row[1] for row in cells for name in re.findall(r"`([^`]+)`", row[0])}


def packages_in(folder: Path) -> set[str]:
    return {path.parent.name for path in folder.glob("*/__init__.py")}


PRODUCT = {
    name: content
    for table in ("ground floor: pure, or data", "processes", "the fleet as a whole")
    for name, content in rows_of(table).items()
}


def test_the_architecture_names_the_folders_of_the_product_and_no_others() -> None:
    beside_links = {"rcopterx/compiling", "rcopterx/places.py", "rcopterx/user_text.py"}
    assert set(PRODUCT) == {*FOLDERS} | beside_links


@pytest.mark.parametrize("folder", [name for name in FOLDERS if name != "agents"])
def test_the_architecture_names_the_packages_of_a_folder(folder: str) -> None:
    packages = packages_in(ROOT / folder) - set(FOLDERS) - {"compiling"}
    named = set(re.findall(r"`([^`]+)`", PRODUCT[folder]))
    assert packages <= named
    assert all((ROOT / folder / name).is_dir() or (ROOT / folder / f"{name}.py").is_file() for name in named)


def test_the_architecture_names_the_parts_of_studies_and_no_others() -> None:
    named = rows_of("part of `studies/rcopterx_studies/`")
    assert set(named) == packages_in(ROOT / "studies" / "rcopterx_studies")


def test_the_parts_of_an_agent_are_those_of_its_import_contract() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    (layers,) = [
        row["layers"] for row in contracts["contracts"] if row.get("containers") == ["rcopterx.agents"]
    ]
    assert sorted(rows_of("part")) == sorted(name for layer in layers for name in layer.split(" | "))


@pytest.mark.parametrize(
    ("heading", "most"),
    [("One pose from socket to radio", 12), ("One goto from the command line to the plan", 15)],
)
def test_a_path_through_the_code_names_few_files(heading: str, most: int) -> None:
    section = ARCHITECTURE.partition(f"## {heading}\n")[2].partition("\n## ")[0]
    assert 5 < len(re.findall(r"`[\w/]+\.py`", section)) <= most


PAGES = sorted((ROOT / "docs").rglob("*.md"))
LINK = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)")


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES], ids=lambda path: path.name
)
def test_every_link_of_a_page_leads_somewhere(page: Path) -> None:
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


MODULE = re.compile(rf"\b((?:{'|'.join([*FOLDERS, 'tests', 'examples'])})/[\w/]+\.py)\b")


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES], ids=lambda path: path.name
)
def test_every_module_that_a_page_names_exists(page: Path) -> None:
    named = set(MODULE.findall(page.read_text(encoding="utf-8")))
    assert [path for path in sorted(named) if not (ROOT / path).is_file()] == []


OUTSIDE_THE_SITE = ("README.md", "CONTRIBUTING.md", ".github/SECURITY.md")
"""Pages whose anchors `make docs` does not check."""


def anchors_of(page: Path) -> set[str]:
    """Anchors that GitHub and the documentation site give to the headings of a page."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("name", OUTSIDE_THE_SITE)
def test_every_anchor_that_a_page_outside_the_site_names_is_a_heading(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    for path, anchor in re.findall(r"\]\(([^)#:]*)#([^)]+)\)", text):
        assert anchor in anchors_of((ROOT / name).parent / path if path else ROOT / name), f"{path}#{anchor}"


ANSWERS_NO_QUESTION = ("commands.md", "index.md")
"""The usage of all commands, and the overview."""


@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if page.parent == ROOT / "docs" and page.name not in ANSWERS_NO_QUESTION],
    ids=lambda page: page.name,
)
def test_the_first_sentence_of_a_page_is_the_question_that_it_answers(page: Path) -> None:
    _, _, text = page.read_text(encoding="utf-8").partition("\n\n")
    assert re.match(r"[^.?:|]+\?\s", text)


def test_the_documentation_site_has_every_page_once() -> None:
    settings = (ROOT / "packaging" / "mkdocs.yml").read_text(encoding="utf-8")
    named = re.findall(r"^ +- .*?([\w-]+(?:/[\w-]+)*\.md)$", settings, re.MULTILINE)
    pages = [page.relative_to(ROOT / "docs").as_posix() for page in PAGES if page.parent != DECISIONS]
    assert sorted(named) == sorted([*pages, "decisions/index.md"])


def title_of(page: Path) -> str:
    return page.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")


def test_the_navigation_shows_the_titles_of_the_pages() -> None:
    settings = (ROOT / "packaging" / "mkdocs.yml").read_text(encoding="utf-8")
    assert re.findall(r"^ +- .+: .+\.md$", settings, re.MULTILINE) == []


def test_the_readme_names_the_pages_to_read_next_by_their_titles() -> None:
    section = README.partition("## Where to go next\n")[2].partition("\n\nThe ")[0]
    named = re.findall(r"\[([^\]]+)\]\(([^)]+)\)", section)
    assert 8 < len(named) <= 16
    assert [text for text, path in named if text != title_of(ROOT / path)] == []


def test_search_ranks_pages_for_users_above_decisions() -> None:
    def boost(path: str, *sections: str) -> float:
        ancestors = [SimpleNamespace(title=title) for title in reversed(sections)]
        page = SimpleNamespace(file=SimpleNamespace(src_uri=path), ancestors=ancestors, meta={})
        assert on_page_markdown("# Text", page=page) == "# Text"
        return float(page.meta["search"]["boost"])

    user = boost("crazyflie.md", "How to", "Set up hardware")
    assert user > boost("architecture.md", "Explanation") > boost("decisions/one.md")
    assert boost("decisions/index.md", "For those who change it") == boost("decisions/one.md")


DECISIONS = ROOT / "docs" / "decisions"


def test_decisions_are_short_enough_to_read() -> None:
    assert sum(len(page.read_text(encoding="utf-8").split()) for page in DECISIONS.glob("*.md")) <= 8000


def test_the_index_names_every_decision_once() -> None:
    named = re.findall(r"\]\(([^)]+)\)", (DECISIONS / "index.md").read_text(encoding="utf-8"))
    assert sorted(named) == sorted(page.name for page in DECISIONS.glob("*.md") if page.name != "index.md")


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page.parent.name == "decisions"], ids=lambda p: p.stem
)
def test_a_decision_fits_on_twenty_lines(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    if page.name != "index.md":
        assert len(text.splitlines()) <= 20
        assert all(f"**{part}.**" in text for part in ("Decision", "Why", "Consequence"))


PAGE_NAMED = re.compile(r"\b((?:docs/)?(?:[\w.-]+/)*[\w-]+\.md)\b")


def prose_of(module: Path) -> list[str]:
    """Docstrings and comments of a module."""
    text = module.read_text(encoding="utf-8")
    docstrings = [
        node.value.value
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    ]
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return docstrings + [token.string for token in tokens if token.type == tokenize.COMMENT]


def test_every_page_that_the_code_names_is_a_page_of_the_repository() -> None:
    pages = [
        path.relative_to(ROOT).as_posix()
        for path in (
            *ROOT.glob("*.md"),
            *(ROOT / "docs").rglob("*.md"),
            *(ROOT / ".github").glob("*.md"),
            *(ROOT / "paper").glob("*.md"),
        )
    ]
    modules = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    missing = [
        f"{module.relative_to(ROOT)}: {name}"
        for module in modules
        if ".md" in module.read_text(encoding="utf-8")
        for prose in prose_of(module)
        for name in PAGE_NAMED.findall(prose)
        if not any(page == name or page.endswith(f"/{name}") for page in pages)
    ]
    assert len(modules) > 300
    assert missing == []


def test_the_code_names_no_numbered_section_of_a_page() -> None:
    """Headings of pages have no numbers, so such a reference is to some other document."""
    for module in [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]:
        assert not re.search(r"\.md`?\s+sections?\s+\d", module.read_text(encoding="utf-8")), module
