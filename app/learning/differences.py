"""Whether a person has found anything wrong of a recognized result: zones that went or were drawn, and cells too."""

from services.contract.boxes import are_one_place, holds_middle
from services.contract.result_json import LabelledZoneJson, ResultJson, TableJson


def is_corrected(found: ResultJson, shown: ResultJson) -> bool:
    """Whether a result as a person verified it differs from the recognized one: class, zones, labels, texts, cells.

    A cell that the person drew is compared in the tables, and so is an unlabelled zone that cells took the place of.
    """
    if _class(found) != _class(shown) or _cells(found) != _cells(shown):
        return True
    columns = {label for table in shown.get("tables", []) for label in table["columns"]}
    drawn = [zone["box"] for zone in shown["zones"] if zone["label"] in columns]
    rest = list(found["zones"])
    for zone in shown["zones"]:
        same = next((each for each in rest if _is_same(zone, each)), None)
        if same is not None:
            rest.remove(same)
        elif zone["label"] not in columns:
            return True
    return any(
        zone["label"] is not None or not any(holds_middle(zone["box"], box) for box in drawn) for zone in rest
    )


def _class(result: ResultJson) -> str | None:
    return None if result["class"] is None else result["class"]["name"]


def _is_same(zone: LabelledZoneJson, found: LabelledZoneJson) -> bool:
    same = (zone["label"], zone["text"]) == (found["label"], found["text"])
    return same and are_one_place(zone["box"], found["box"])


def _cells(result: ResultJson) -> list[list[dict[str, list[str]]]]:
    """The words of each cell by its column, of each row of each table: not boxes, which a person draws anew."""
    return [_rows(table) for table in result.get("tables", [])]


def _rows(table: TableJson) -> list[dict[str, list[str]]]:
    return [
        {
            label: cell["text"].split()
            for label, cell in zip(table["columns"], row, strict=True)
            if cell is not None
        }
        for row in table["rows"]
    ]
