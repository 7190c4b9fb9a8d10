"""What a package offers without loading it: the imports that it states for type checkers alone."""


def offered_names(file: str) -> dict[str, str]:
    """Module of each name in the indented lines `from module import name as name` of a package's file."""
    with open(file, encoding="utf-8") as source:  # noqa: PTH123  # pathlib takes a while to load
        lines = [line.split() for line in source if line.startswith("    from ")]
    return {words[5]: words[1] for words in lines if words[4:5] == ["as"]}
