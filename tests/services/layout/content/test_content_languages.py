"""Content features of pages in German, French and Spanish: the language is found, and its words count."""

from pathlib import Path

import pytest

from services.layout.content.content_features import ContentFeatures, page_language
from services.layout.content.content_settings import LANGUAGE_FILES, read_settings
from services.layout.content.text_language import find_language, own_words
from services.layout.page import Page, Zone

FEATURES = ContentFeatures.load()
BODIES = {
    "deu": "vielen Dank für Ihr Schreiben. Wir haben die Lampen geprüft und werden sie in der nächsten Woche mit der "
    "Post an Sie senden. Die Rechnung liegt dem Paket bei, und Sie können sie bis zum Ende des Monats bezahlen.",
    "fra": "nous vous remercions de votre lettre. Les lampes ont été vérifiées et elles vous seront envoyées la "
    "semaine prochaine par la poste. La facture est dans le colis et vous pouvez la payer avant la fin du mois.",
    "spa": "le agradecemos su carta. Hemos revisado las lámparas y se las enviaremos por correo la próxima semana. La "
    "factura está en el paquete y usted puede pagarla antes del final del mes, como siempre.",
    "eng": "thank you for your letter. We have tested the lamps and they will be sent to you by mail in the next week. "
    "The bill is in the parcel, and you may pay it before the end of the month.",
}
CUES = [
    ("deu", "greeting", "Sehr geehrte Frau Bell,"),
    ("deu", "greeting", "Sehr geehrte Damen und Herren"),
    ("deu", "closing", "Mit freundlichen Grüßen"),
    ("deu", "closing", "Mit freundlichcn Grüßen"),
    ("deu", "date", "Hamburg, den 12. März 2024"),
    ("deu", "subject", "Betreff: Ihre Bestellung"),
    ("deu", "enclosure", "Anlagen"),
    ("deu", "location", "Lindenstraße 12"),
    ("deu", "zipcode", "10115 Berlin"),
    ("deu", "name", "Herr Dr. Klaus Berger"),
    ("deu", "organization", "Stadtwerke Nordheim GmbH"),
    ("deu", "caption", "Abb. 3: Die Lampe"),
    ("deu", "cc", "Verteiler: alle Abteilungen"),
    ("fra", "greeting", "Madame, Monsieur,"),
    ("fra", "greeting", "Chère Madame,"),
    ("fra", "closing", "Veuillez agréer, Madame, l'expression de mes sentiments distingués."),
    ("fra", "closing", "Bien cordialement"),
    ("fra", "date", "Lyon, le 1er août 2023"),
    ("fra", "subject", "Objet : votre commande"),
    ("fra", "enclosure", "Pièces jointes"),
    ("fra", "location", "12, rue des Tilleuls"),
    ("fra", "zipcode", "69003 Lyon"),
    ("fra", "name", "Mme Hélène Girard"),
    ("fra", "organization", "Société des Lampes"),
    ("fra", "phone", "04 72 00 12 34"),
    ("spa", "greeting", "Estimados señores:"),
    ("spa", "closing", "Atentamente,"),
    ("spa", "closing", "Reciba un cordial saludo"),
    ("spa", "date", "Madrid, a 3 de mayo de 2022"),
    ("spa", "subject", "Asunto: su pedido"),
    ("spa", "enclosure", "Anexos"),
    ("spa", "location", "Calle de los Olmos, 12"),
    ("spa", "zipcode", "28013 Madrid"),
    ("spa", "name", "Sra. Carmen Ortega"),
    ("spa", "ps", "P.D.: Escriba pronto."),
    ("spa", "organization", "Ayuntamiento de Olmedo"),
]


def letter(language: str, text: str) -> Page:
    """A page with a zone of `text` above a paragraph in a language."""
    zones = [
        Zone(f"z{n}", (10.0, 40.0 * n, 500.0, 40.0 * n + 30), text=t)
        for n, t in enumerate((text, BODIES[language]))
    ]
    return Page(600, 800, tuple(zones))


@pytest.mark.parametrize(("language", "feature", "text"), CUES)
def test_cues_count_on_pages_in_their_language(language: str, feature: str, text: str) -> None:
    page = letter(language, text)
    assert page_language(page) == language
    assert FEATURES.measure_page(page).zones[0].content[feature] >= 0.6


@pytest.mark.parametrize("language", sorted(LANGUAGE_FILES))
def test_words_of_a_language_count_on_its_pages_only(language: str) -> None:
    """Of the cues that English has too, some count on English pages; most do not."""
    cues = [(feature, text) for each, feature, text in CUES if each == language]
    english = [FEATURES.measure_page(letter("eng", text)).zones[0].content[feature] for feature, text in cues]
    assert sum(value >= 0.6 for value in english) <= len(cues) / 2


def test_the_paragraph_is_prose_and_no_greeting_in_its_language() -> None:
    for language in BODIES:
        content = FEATURES.measure_page(letter(language, "12")).zones[1].content
        assert content["prose"] == 1.0
        assert content["greeting"] == content["closing"] == 0.0


def test_all_languages_have_the_same_features(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text("[ps]\nremove = true\n[tax]\nphrases = ['tax']", encoding="utf-8")
    for path in (None, mine):
        names = {tuple(each.name for each in read_settings(path, language)) for language in BODIES}
        assert len(names) == 1


def test_a_users_words_count_in_every_language(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text('[greeting]\nphrases = ["moin"]', encoding="utf-8")
    features = ContentFeatures.load(mine)
    for language in BODIES:
        assert features.measure_page(letter(language, "Moin")).zones[0].content["greeting"] == 1.0


def test_english_pages_are_measured_as_single_zones_are() -> None:
    page = letter("eng", "Dear Mrs. Bell,")
    assert page_language(page) == "eng"
    for zone, measured in zip(page.zones, FEATURES.measure_page(page).zones, strict=True):
        assert measured.content == FEATURES.measure(zone.text)


def test_a_language_needs_enough_words_of_its_own() -> None:
    words = own_words({"eng": ("the", "and", "in"), "deu": ("der", "und", "in", "ist")})
    assert words["deu"] == {"der", "und", "ist"}
    assert find_language(["in in in in in"], words, "eng") == "eng"
    assert find_language(["der und ist"], words, "eng") == "eng"
    assert find_language(["Der Hund und die Katze: der eine ist klein"], words, "eng") == "deu"
    assert find_language(["the dog and the cat " * 3, "der und ist der"], words, "eng") == "eng"
    assert find_language(["x" * 30_000, "der und ist der und"], words, "eng") == "eng"


def test_a_page_without_text_is_left_as_it_is() -> None:
    page = Page(600, 800, (Zone("z0", (0.0, 0.0, 10.0, 10.0), kind="figure"),))
    assert FEATURES.measure_page(page) is page
