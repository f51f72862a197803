"""Invented people, firms, addresses and sentences, to set labelled pages with. Nobody and nothing of them exists."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")

FIRST_NAMES = (
    "Alice", "Bernard", "Carla", "David", "Elena", "Frank", "Grace", "Henry", "Irene", "James", "Karen",
    "Louis", "Maria", "Nadia", "Oscar", "Paul", "Rita", "Samuel", "Teresa", "Victor", "Walter", "Yvonne",
)  # fmt: skip
LAST_NAMES = (
    "Abernathy", "Bell", "Castillo", "Dunmore", "Ellery", "Fontaine", "Garrick", "Holloway", "Ibarra",
    "Jennings", "Kowal", "Lindqvist", "Marchetti", "Norwood", "Okafor", "Pettigrew", "Quill", "Rasmussen",
    "Sandoval", "Thackeray", "Underhill", "Vasquez", "Whitlock", "Yamada",
)  # fmt: skip
COURTESY = ("Mr.", "Ms.", "Mrs.", "Dr.", "Prof.")
POSITIONS = (
    "Director of Purchasing", "Vice President", "Head, Circulation Department", "Sales Manager",
    "Chief Engineer", "Assistant Treasurer", "Secretary to the Board", "General Counsel",
)  # fmt: skip
FIRM_STEMS = (
    "Alder Creek", "Bluestone", "Copperfield", "Eastgate", "Harbor Point", "Kestrel", "Millbrook",
    "Northlight", "Old Orchard", "Quarry Hill", "Silver Birch", "Westmark",
)  # fmt: skip
FIRM_KINDS = (
    "Instruments, Inc.", "Savings Bank", "Publishing Company", "Medical Center", "Travel Agency",
    "Paper Products, Ltd.", "School District", "& Sons Company", "Foundation", "Insurance Corporation",
)  # fmt: skip
STREETS = ("Main", "Elm", "Prospect", "Lincoln", "Mill", "River", "Church", "Orchard", "Second", "Union")
STREET_KINDS = ("Street", "Avenue", "Road", "Blvd.", "Drive", "Lane")
TOWNS = (
    "Fairmount, MD", "Ashford, Virginia", "Lakewood, OH", "Brookside, New York", "Cedar Falls, TX",
    "Granville, CA", "Port Allen, WA", "Maple Grove, Illinois", "Stony Point, MA",
)  # fmt: skip
UNIVERSITIES = (
    "University of Northfield", "Harrow Institute of Technology", "Lakeshore State University",
    "National Laboratory for Paper Research", "College of the Western Isles", "Marlow Research, Inc.",
)  # fmt: skip
DEPARTMENTS = (
    "Department of Computer Science", "Department of Physics", "School of Engineering",
    "Faculty of Mathematics", "Institute for Statistics",
)  # fmt: skip
COUNTRIES = ("USA", "Germany", "Japan", "Brazil", "United Kingdom", "France", "India")
MONTHS = (
    "January", "February", "March", "April", "May", "June", "July", "August", "September", "October",
    "November", "December",
)  # fmt: skip
CLOSINGS = (
    "Sincerely,", "Sincerely yours,", "Yours sincerely,", "Very truly yours,", "Yours truly,", "Cordially,",
    "Best regards,", "Kind regards,", "Respectfully yours,", "With best wishes,",
)  # fmt: skip
SUBJECTS = (
    "Renewal of the service contract", "Your order of spare bindings", "Shipment of reading lamps",
    "Minutes of the spring meeting", "Invoice for repairs", "Change of telephone numbers",
    "Application for the post of archivist",
)  # fmt: skip
LETTER_SENTENCES = (
    "We were glad to learn from your last letter that the parcels came through without damage.",
    "The second half of the order will leave our warehouse as soon as the lamps have been tested.",
    "You will find the corrected invoice with this letter, and we regret the error in the first one.",
    "Our engineer is free to visit your plant in the week after next, on any morning that suits you.",
    "The committee has read the proposal with interest and asks for figures of the running costs.",
    "Under the terms of the agreement either side may end the lease with a notice of ninety days.",
    "Three of the five samples were within the limits, and two were a little too damp to be measured.",
    "I should be grateful for a short reply by return of post, so that the seats can be reserved.",
    "The price includes delivery to your door, but not the unpacking or the removal of the old machine.",
    "Since we spoke on the telephone I have gone through the files of the last four years again.",
    "No payment is due before the work has been accepted by both of the inspectors.",
    "It would help us greatly to know how many copies of the catalogue your branches can use.",
    "The meeting will be held in the small reading room, and tea will be served at four.",
    "We expect that the repairs to the roof will be finished before the first snow.",
    "If the enclosed form is signed and returned this month, the earlier rate still applies.",
    "Thank you again for the patience that you have shown in this matter.",
)
PAPER_SENTENCES = (
    "Measurements of this kind have long been made by hand, and their errors are not well understood.",
    "The proposed method needs neither a special device nor a calibration of the camera beforehand.",
    "Earlier approaches assume that the surface is flat, which rarely holds outside of the laboratory.",
    "In contrast, the estimate given here follows from the texture of the observed pattern alone.",
    "We show that the energy has one minimum only when the samples are dense enough.",
    "Experiments on synthetic and on real images confirm that the error falls by about one third.",
    "The software is distributed with its documentation, its tests and a set of worked examples.",
    "A user describes the problem in a short script and obtains tables and figures that can be reproduced.",
    "The remainder of the text is organized as follows: the model comes first, then its estimation.",
    "Let the graph have as many nodes as there are regions, and an edge between each two of them.",
    "The running time grows linearly with the number of observations and stays below a second.",
    "Similar questions arise in the study of rivers, of fabrics and of the growth of crystals.",
    "The parameters were chosen once and were not changed between the data sets.",
    "Several packages offer parts of this functionality, but none of them treats missing values.",
    "Students of the course used the tool for two terms and answered a questionnaire at the end.",
    "Both variants converge to the same solution, although the second one takes fewer steps.",
)
TITLE_STARTS = (
    "On the estimation of", "A fast method for", "Robust inference of", "Teaching with", "A package for",
    "Rethinking", "Scalable simulation of", "Bounds for",
)  # fmt: skip
TITLE_ENDS = (
    "curved surfaces from a single view", "sparse networks with noisy edges", "tidal currents in estuaries",
    "reproducible notebooks in physics courses", "matching problems on attributed graphs",
    "seasonal patterns in long records", "stiff differential equations",
)  # fmt: skip
KEYWORDS = (
    "graph matching", "inference", "open source", "rivers", "optimization", "image analysis", "statistics",
    "teaching", "simulation", "Python", "time series", "uncertainty",
)  # fmt: skip
SECTIONS = ("Introduction", "Background", "Statement of need", "Related work", "Method", "Overview")


def pick(rng: np.random.Generator, choices: Sequence[T]) -> T:
    """One of the choices, all alike likely."""
    return choices[int(rng.integers(len(choices)))]


def person(rng: np.random.Generator, *, courtesy: bool = False) -> str:
    """A first and a last name, half of the time with a middle initial."""
    middle = f" {chr(65 + int(rng.integers(26)))}." if rng.random() < 0.5 else ""
    name = f"{pick(rng, FIRST_NAMES)}{middle} {pick(rng, LAST_NAMES)}"
    return f"{pick(rng, COURTESY)} {name}" if courtesy else name


def firm(rng: np.random.Generator) -> str:
    """The name of a firm."""
    return f"{pick(rng, FIRM_STEMS)} {pick(rng, FIRM_KINDS)}"


def street(rng: np.random.Generator) -> str:
    """A house number and a street, or a post box."""
    if rng.random() < 0.2:
        return f"P.O. Box {int(rng.integers(100, 9999))}"
    return f"{int(rng.integers(1, 9999))} {pick(rng, STREETS)} {pick(rng, STREET_KINDS)}"


def town(rng: np.random.Generator) -> str:
    """A town, its state and its ZIP code."""
    code = f"{int(rng.integers(10000, 99999))}"
    extension = f"-{int(rng.integers(1000, 9999))}" if rng.random() < 0.2 else ""
    return f"{pick(rng, TOWNS)} {code}{extension}"


def phone(rng: np.random.Generator) -> str:
    """A telephone number with an area code."""
    area, office, line = int(rng.integers(201, 989)), int(rng.integers(200, 999)), int(rng.integers(9999))
    return f"({area}) {office}-{line:04d}" if rng.random() < 0.6 else f"{area}-{office}-{line:04d}"


def date(rng: np.random.Generator) -> str:
    """A day, in one of five ways to write it."""
    day, year, month = int(rng.integers(1, 29)), int(rng.integers(1965, 2024)), int(rng.integers(12))
    name = MONTHS[month]
    ways = (
        f"{name} {day}, {year}", f"{name} {day}, {year}", f"{day} {name} {year}", f"{name[:3]}. {day}, {year}",
        f"{month + 1}/{day}/{year % 100:02d}",
    )  # fmt: skip
    return pick(rng, ways)


def sentences(rng: np.random.Generator, bank: Sequence[str], count: int) -> str:
    """So many sentences of the bank, none twice, as one paragraph."""
    order = rng.permutation(len(bank))[:count]
    return " ".join(bank[int(index)] for index in order)


def title(rng: np.random.Generator) -> str:
    """A paper's title."""
    return f"{pick(rng, TITLE_STARTS)} {pick(rng, TITLE_ENDS)}"


def initials(name: str) -> str:
    """The capitals that begin the words of a name: `Grace T. Bell` -> `GTB`."""
    return "".join(word[0] for word in name.split() if word[0].isupper())
