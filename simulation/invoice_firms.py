"""Twelve invented firms that write invoices, three in each of four languages: their words and how they set a page.

Nobody and nothing of them exists. What a firm prints is the same on all of its invoices; what it sells is drawn.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Language = Literal["en", "de", "fr", "es"]
Kind = Literal["position", "article", "description", "quantity", "unit", "price", "discount", "tax", "amount"]
Meta = Literal["lines", "columns", "boxes"]
"""Where number and date are: behind their keys, in a column right of them, or below them."""
Rules = Literal["none", "header", "rows", "grid"]


@dataclass(frozen=True, slots=True)
class Column:
    """A column of the items: what it holds, the words above it, its share of the table's width."""

    kind: Kind
    header: str
    share: float
    align: Literal["left", "right", "centre"] = "left"


@dataclass(frozen=True, slots=True)
class Firm:
    """What is the same on every invoice of a firm.

    `day` is a pattern of `day`, `month` (01-12), `name` (of the month, `short` its first letters) and `year`; `number`
    one of a running `n` and `year`. `keys` are those of number, date, subtotal, tax and total. `sign` is printed at
    amounts, `sign_in_cells` in the table too. `wrapped` is the share of items with a second line; with `below` the
    amount is on the last one.
    """

    name: str
    language: Language
    address: str
    title: str
    day: str
    number: str
    keys: tuple[str, str, str, str, str]
    columns: tuple[Column, ...]
    meta: Meta = "lines"
    rules: Rules = "none"
    sign: str = "€"
    sign_in_cells: bool = False
    serif: bool = False
    size: float = 19.0
    centred: bool = False
    customer_right: bool = False
    wrapped: float = 0.0
    below: bool = False
    tax_percent: int = 20
    keys_at_left: bool = False
    header_again: bool = True
    carried: str = ""


def _columns(*given: tuple[Kind, str, float, str]) -> tuple[Column, ...]:
    return tuple(Column(kind, header, share, align) for kind, header, share, align in given)  # type: ignore[arg-type]


FIRMS: tuple[Firm, ...] = (
    Firm(
        "Alder Creek Joinery Ltd", "en", "14 Mill Lane, Ashford AS3 7QT", "Invoice", "{day} {name} {year}", "AC-{n}",
        ("Invoice no.:", "Date:", "Subtotal", "VAT 20%", "Total due"),
        _columns(("description", "Description", 0.5, "left"), ("quantity", "Qty", 0.12, "right"),
                 ("price", "Unit price", 0.18, "right"), ("amount", "Amount", 0.2, "right")),
        rules="header", sign="£",
    ),
    Firm(
        "BLUESTONE SUPPLY COMPANY", "en", "2200 Prospect Avenue, Lakewood, OH 44107", "INVOICE",
        "{short} {day}, {year}", "{n}", ("INVOICE NUMBER", "INVOICE DATE", "SUBTOTAL", "SALES TAX", "AMOUNT DUE"),
        _columns(("quantity", "QTY", 0.1, "centre"), ("article", "ITEM #", 0.16, "left"),
                 ("description", "DESCRIPTION", 0.4, "left"), ("price", "PRICE EACH", 0.17, "right"),
                 ("amount", "LINE TOTAL", 0.17, "right")),
        meta="boxes", rules="grid", sign="$", sign_in_cells=True, tax_percent=7, customer_right=True,
    ),
    Firm(
        "Harbor Point Marine Services", "en", "Quay 3, Port Allen PA1 2LN", "Tax invoice", "{day}/{month}/{year}",
        "HP/{year}/{n}", ("Our reference", "Issued on", "Net amount", "VAT at 20%", "Balance payable"),
        _columns(("position", "#", 0.06, "left"), ("description", "Work done", 0.44, "left"),
                 ("quantity", "Hours", 0.12, "right"), ("price", "Rate", 0.16, "right"),
                 ("amount", "Charge", 0.22, "right")),
        meta="columns", serif=True, sign="£", wrapped=0.6, size=20.0,
    ),
    Firm(
        "Tischlerei Ahrens GmbH", "de", "Lindenweg 8, 23843 Bad Oldesloe", "Rechnung", "{day}.{month}.{year}", "RE-{n}",
        ("Rechnungsnummer:", "Datum:", "Zwischensumme", "zzgl. 19 % MwSt.", "Gesamtbetrag"),
        _columns(("position", "Pos.", 0.07, "left"), ("description", "Bezeichnung", 0.41, "left"),
                 ("quantity", "Menge", 0.11, "right"), ("unit", "Einheit", 0.11, "left"),
                 ("price", "Einzelpreis", 0.15, "right"), ("amount", "Gesamtpreis", 0.15, "right")),
        rules="header", wrapped=0.4, tax_percent=19, carried="Übertrag",
    ),
    Firm(
        "Nordlicht Bürobedarf KG", "de", "Hafenstraße 21, 24103 Kiel", "RECHNUNG", "{day}. {name} {year}", "{year}/{n}",
        ("Rechnungs-Nr.", "Rechnungsdatum", "Nettobetrag", "Umsatzsteuer 19 %", "Rechnungsbetrag"),
        _columns(("quantity", "Anzahl", 0.1, "right"), ("description", "Artikel", 0.42, "left"),
                 ("price", "Preis", 0.14, "right"), ("discount", "Rabatt", 0.12, "right"),
                 ("amount", "Betrag", 0.22, "right")),
        meta="columns", rules="rows", sign_in_cells=True, tax_percent=19, size=18.0, header_again=False,
    ),
    Firm(
        "Kessler & Söhne Elektrotechnik", "de", "Am Markt 5, 35037 Marburg", "Rechnung", "{day}.{month}.{year}",
        "{n}-{year}", ("Beleg-Nr.", "Belegdatum", "Summe netto", "MwSt. 19%", "Summe brutto"),
        _columns(("article", "Art.-Nr.", 0.14, "left"), ("description", "Leistung", 0.38, "left"),
                 ("price", "EP", 0.14, "right"), ("quantity", "Stück", 0.1, "right"), ("tax", "USt", 0.09, "right"),
                 ("amount", "GP", 0.15, "right")),
        meta="boxes", serif=True, wrapped=0.3, below=True, tax_percent=19, customer_right=True,
    ),
    Firm(
        "Menuiserie Garnier SARL", "fr", "7 rue des Tilleuls, 44000 Nantes", "Facture", "{day}/{month}/{year}",
        "F{year}-{n}", ("Facture n° :", "Date :", "Total HT", "TVA 20 %", "Total TTC"),
        _columns(("description", "Désignation", 0.46, "left"), ("quantity", "Qté", 0.1, "right"),
                 ("price", "Prix unitaire", 0.2, "right"), ("amount", "Montant", 0.24, "right")),
        rules="grid", sign_in_cells=True,
    ),
    Firm(
        "Papeterie du Vieux Port", "fr", "12 quai du Port, 13002 Marseille", "FACTURE", "{day} {name} {year}", "{n}",
        ("Numéro", "Date de facture", "Montant HT", "TVA", "Net à payer"),
        _columns(("article", "Réf.", 0.13, "left"), ("description", "Libellé", 0.35, "left"),
                 ("unit", "Unité", 0.1, "left"), ("quantity", "Quantité", 0.12, "right"),
                 ("price", "P.U. HT", 0.14, "right"), ("amount", "Total HT", 0.16, "right")),
        meta="columns", rules="header", size=18.0, centred=True,
    ),
    Firm(
        "Atelier Mécanique Roussel", "fr", "Zone du Moulin, 67000 Strasbourg", "Facture", "{day} {name} {year}",
        "FA {n}", ("N° de facture", "Émise le", "Sous-total", "TVA 20 %", "Montant dû"),
        _columns(("quantity", "Nombre", 0.12, "centre"), ("description", "Description", 0.46, "left"),
                 ("price", "Prix", 0.18, "right"), ("amount", "Somme", 0.24, "right")),
        meta="boxes", serif=True, wrapped=0.5, size=20.0, keys_at_left=True,
    ),
    Firm(
        "Carpintería Robledo S.L.", "es", "Calle del Olmo 18, 28012 Madrid", "Factura", "{day}/{month}/{year}", "A-{n}",
        ("Factura n.º:", "Fecha:", "Base imponible", "IVA 21 %", "Total factura"),
        _columns(("description", "Concepto", 0.48, "left"), ("quantity", "Cantidad", 0.14, "right"),
                 ("price", "Precio", 0.16, "right"), ("amount", "Importe", 0.22, "right")),
        rules="rows", tax_percent=21, wrapped=0.25,
    ),
    Firm(
        "SUMINISTROS DEL NORTE", "es", "Avenida de la Ría 40, 48001 Bilbao", "FACTURA", "{day} de {name} de {year}",
        "{year}-{n}", ("Número de factura", "Fecha de emisión", "Subtotal", "I.V.A. 21%", "TOTAL A PAGAR"),
        _columns(("article", "Código", 0.13, "left"), ("quantity", "Uds.", 0.09, "right"),
                 ("description", "Descripción", 0.38, "left"), ("price", "Precio ud.", 0.15, "right"),
                 ("discount", "Dto.", 0.09, "right"), ("amount", "Total", 0.16, "right")),
        meta="columns", rules="grid", sign_in_cells=False, tax_percent=21, size=18.0, carried="Suma y sigue",
    ),
    Firm(
        "Talleres Ibarra", "es", "Plaza Mayor 3, 31001 Pamplona", "Factura", "{day}.{month}.{year}", "TI{n}",
        ("Nº", "Fecha", "Suma", "IVA", "A pagar"),
        _columns(("description", "Trabajo", 0.44, "left"), ("price", "Precio/hora", 0.18, "right"),
                 ("quantity", "Horas", 0.14, "right"), ("amount", "Importe", 0.24, "right")),
        meta="lines", serif=True, tax_percent=21, sign_in_cells=True, centred=True,
    ),
)  # fmt: skip

MONTHS: Mapping[Language, tuple[str, ...]] = {
    "en": ("January", "February", "March", "April", "May", "June", "July", "August", "September", "October",
           "November", "December"),
    "de": ("Januar", "Februar", "März", "April", "Mai", "Juni", "Juli", "August", "September", "Oktober",
           "November", "Dezember"),
    "fr": ("janvier", "février", "mars", "avril", "mai", "juin", "juillet", "août", "septembre", "octobre",
           "novembre", "décembre"),
    "es": ("enero", "febrero", "marzo", "abril", "mayo", "junio", "julio", "agosto", "septiembre", "octubre",
           "noviembre", "diciembre"),
}  # fmt: skip
GOODS: Mapping[Language, tuple[str, ...]] = {
    "en": ("Oak shelf, planed", "Brass hinge, pair", "Cable drum 25 m", "Copy paper A4", "Deck varnish, clear",
           "Engine oil filter", "Fitting of a door", "Glass pane 4 mm", "Inspection of the pump", "Steel screws, box"),
    "de": ("Eichenregal, gehobelt", "Messingband, Paar", "Kabeltrommel 25 m", "Kopierpapier A4", "Klarlack, matt",
           "Montage einer Tür", "Glasscheibe 4 mm", "Prüfung der Anlage", "Stahlschrauben, Karton", "Steckdose, weiß"),
    "fr": ("Étagère en chêne", "Charnière en laiton", "Rouleau de câble 25 m", "Papier A4 blanc", "Vernis incolore",
           "Pose d'une porte", "Vitre 4 mm", "Contrôle de la pompe", "Vis en acier, boîte", "Filtre à huile"),
    "es": ("Estante de roble", "Bisagra de latón", "Rollo de cable 25 m", "Papel A4 blanco", "Barniz mate",
           "Montaje de puerta", "Vidrio 4 mm", "Revisión de la bomba", "Tornillos de acero", "Filtro de aceite"),
}  # fmt: skip
DETAILS: Mapping[Language, tuple[str, ...]] = {
    "en": ("as agreed on 3 May", "including delivery", "length 80 cm, depth 30", "second visit"),
    "de": ("laut Angebot vom 3. Mai", "inkl. Lieferung", "Länge 80 cm, Tiefe 30", "zweiter Termin"),
    "fr": ("selon devis du 3 mai", "livraison comprise", "longueur 80 cm", "deuxième visite"),
    "es": ("según oferta del 3 de mayo", "entrega incluida", "longitud 80 cm", "segunda visita"),
}
UNITS: Mapping[Language, tuple[str, ...]] = {
    "en": ("pcs", "h", "m"), "de": ("Stk.", "Std.", "m"), "fr": ("pce", "h", "m"), "es": ("ud.", "h", "m"),
}  # fmt: skip
CUSTOMERS: Mapping[Language, tuple[tuple[str, str, str], ...]] = {
    "en": (("Westmark School District", "90 Church Road", "Granville GR1 8PB"),
           ("Quarry Hill Foundation", "5 Orchard Street", "Brookside BR2 4HN"),
           ("Mrs Irene Holloway", "27 River Lane", "Stony Point SP9 1AA")),
    "de": (("Stadtwerke Eschenau", "Bahnhofstraße 12", "91054 Erlangen"),
           ("Frau Karin Lindner", "Birkenallee 7", "50667 Köln"),
           ("Verlag Morgenrot GmbH", "Schillerplatz 1", "01067 Dresden")),
    "fr": (("Lycée Jean Moulin", "25 avenue Victor Hugo", "69002 Lyon"),
           ("Madame Claire Fontaine", "3 place du Marché", "59000 Lille"),
           ("Éditions du Lac", "18 rue Pasteur", "74000 Annecy")),
    "es": (("Colegio San Martín", "Calle Mayor 22", "50001 Zaragoza"),
           ("Doña Elena Castillo", "Paseo del Río 9", "46002 Valencia"),
           ("Librería El Faro", "Calle Nueva 6", "29005 Málaga")),
}  # fmt: skip
FEET: Mapping[Language, str] = {
    "en": "Payable within 30 days. Bank: First Harbour, account 4402 1187. Thank you for your order.",
    "de": "Zahlbar innerhalb von 30 Tagen. Bankverbindung: Nordbank, Konto 4402 1187. Vielen Dank.",
    "fr": "Payable sous 30 jours. Banque du Lac, compte 4402 1187. Merci de votre confiance.",
    "es": "A pagar en 30 días. Banco del Norte, cuenta 4402 1187. Gracias por su pedido.",
}
