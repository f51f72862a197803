"""Parameters of segmentation: typical properties of print."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SegmentationParameters:
    """Lengths are multiples of the em of the print in question, or of the page's glyph height (`unit`)."""

    working_long_side_px: int = 1760
    """The reduced copy: A4 at 150 dpi, where ten-point print has 20 px to the em."""
    largest_enlargement: float = 1.6
    """Largest enlargement of coarse pages (100 dpi): at whole pixels, similar sizes have the same height."""
    least_enlargement: float = 1.2
    """A smaller enlargement is left out: its blur makes letters touch."""
    ink_contrast: float = 0.28
    """Ink is darker than its paper by this share of it; light gray print has about 0.35."""
    most_components: int = 12000
    """Of a page with more (dirt, halftones) the largest count; a full page of small print has about 6000."""
    most_lines: int = 1500
    """And of its lines the widest; a page of small print has 200."""

    largest_skew_deg: float = 3.0
    """Range of the search; pages come upright."""

    least_glyph: float = 0.4
    """Heights of what makes lines, in units: from small print's x-height ..."""
    largest_glyph: float = 6.0
    """... to a large heading's capitals."""
    rule_aspect: float = 9.0
    """Least ratio of a rule's length to its thickness."""
    rule_thickness: float = 0.5
    """Rules are thinner than this, in units."""

    hairline: float = 0.04
    """Strokes finer than this times their height draw no letters but of the smallest print."""

    letter_gap: float = 0.6
    """Components nearer than this times their height are one word, or words near each other."""
    tallest_partner: float = 2.3
    """Largest ratio of the heights of linked components: x-height to brackets is 2.1."""
    widest_gap: float = 3.0
    """Wider gaps always end a line; three spaces of a typewriter are 2.3."""
    wide_gap: float = 0.7
    """Narrower gaps never end a line: spaces of justified print are 0.2 to 0.7."""
    lone_gap: float = 1.6
    """A gap that one other row shares, and none crosses, ends a line from here on."""
    word_gap: float = 2.0
    """A gap without support from other rows ends a line from here on."""
    least_space: float = 0.2
    """Narrower gaps are between letters."""
    gap_over_space: float = 1.9
    """Least ratio of a gap that ends a line to the spaces between words around it."""
    gutter_over_space: float = 1.1
    """The same where at least `gutter_rows` rows around have the gap, and none crosses it."""
    gutter_rows: int = 4
    widest_space: float = 1.1
    """Spaces are taken to be no wider: a typewriter's are 1.0."""
    gutter_reach: float = 3.6
    """Rows nearer than this support a gap: three lines above and below."""
    operator_aspect: float = 1.5
    """Strokes of "=" and dashes are this elongated, ..."""
    operator_widths: tuple[float, float] = (0.3, 2.0)
    """... have widths between these, in heights of the page's glyphs, ..."""
    operator_gap: float = 2.0
    """... and stand no farther from the words on both sides."""
    most_operators: int = 1000
    """More are dirt."""
    least_cells: int = 8
    """Glyphs of a row that show whether it is monospaced, ..."""
    least_concentration: float = 0.65
    """... by the concentration of their places in cells, ..."""
    least_surprise: float = 10.0
    """... which n glyphs reach by chance exp(-n times its square) times. Its exponent is larger, ..."""
    least_blank_cells: float = 3.7
    """... and narrower gaps, of up to three blanks, are no gutters then."""
    shared_gap: float = 0.5
    """Gaps of two rows, one above the other, that share this width may be one gutter."""
    edge_slack: float = 0.35
    """Edges of print that differ by less are aligned."""

    mark_gap: float = 2.2
    """Largest distance of a list's mark from its line, including the width of the mark."""
    end_gap: float = 0.9
    """Largest distance of a full stop, a superscript or a closing sign from its line."""

    capital_height: float = 0.70
    """Height of capitals and ascenders over em: Times 0.67, Computer Modern 0.69, Helvetica 0.72."""
    small_step: float = 1.08
    """Heights of letters without ascenders differ by less in one size; they are whole pixels."""
    size_step: float = 1.12
    """Lines whose sizes differ by more are set in different sizes: print steps by 1.1 to 1.2."""
    weight_step: float = 1.3
    """Bold strokes are 1.4 to 1.7 times as wide as regular ones."""
    slanted_letters: int = 10
    """Least number of letters that shows whether a line is set in italics ..."""
    slant_step: float = 0.11
    """... which lean by 0.2 more than upright ones; figures and capitals blur that."""
    full_line: float = 12.0
    """Lines of running text are at least this wide, 24 letters: the columns of newspapers. Narrower lines are headings,
    names, entries."""
    tight: float = 1.4
    """Narrower lines with an edge in common stay together, bold or not, if their baselines are nearer than this: a head
    and what it heads."""
    reliable_components: int = 5
    """Sizes and weights of lines with fewer components differ only beyond `unreliable_step`."""
    unreliable_step: float = 1.35
    doubtful_step: float = 1.22
    """Sizes of lines with even spacing count as equal up to this factor."""
    leading_step: float = 1.22
    """A line space wider than the next by this factor divides blocks."""
    largest_leading: float = 1.75
    """Wider spacing needs full lines on both sides (a letter in double spacing)."""
    double_leading: float = 3.2
    """And no print is wider spaced."""
    indent: float = 0.7
    """First lines of paragraphs begin by this much to the right of the others, at least."""
    largest_indent: float = 9.0

    running_margin: float = 0.1
    """Largest distance of running heads and feet from the page's edge, over its height."""
    running_components: int = 10
    """Least number of their glyphs ..."""
    number_digits: int = 4
    """... and largest number of those of a page number,"""
    number_step: float = 1.1
    """which is higher than the capitals next to it by this factor,"""
    number_gap: float = 2.5
    """or apart from them by this multiple of the spaces between words."""
    least_number_gap: float = 0.9
    """Line numbers are at least this far from their lines, ..."""
    sure_number_gap: float = 1.8
    """... and this far where they are not smaller than the print."""
    number_edge_px: float = 3.0
    """Numbers of one column have a common edge, in pixels of the working copy."""
    least_numbers: int = 8
    """A column has at least so many, ..."""
    regular_numbers: float = 0.75
    """... of which this share follow each other by one step."""
    shortest_note: float = 4.8
    """A first line this short at the foot of a letter's text ("JRB:tc", "Encl.") is no name or place."""
    foot_of_text: float = 0.5
    """Notes after a letter's body are below this share of the page's height."""

    least_confidence: float = 0.3
    """Words read with less confidence are no text, but for those in a line that is."""

    widest_label: float = 9.0
    """Labels of entries ("FROM:", "Phone number:") are shorter."""
    entry_gap: float = 4.5
    """Values begin at most this far behind the longest label."""
    entry_tab: float = 9.0
    """The same where the labels have colons: an inch in print of 8 points."""
    lines_per_entry: float = 1.9
    """Largest mean number of lines of the values ..."""
    lines_per_sure_entry: float = 4.0
    """... of labels with colons, as where a memo has many receivers, ..."""
    widest_value: float = 22.0
    """... and largest width; running text is wider."""
    list_reach: float = 12.0
    """Largest distance of neighbouring entries of one list."""
    paragraph_leading: float = 1.45
    """From here on a line that ends early ends its paragraph: the space may be that between paragraphs."""
    early_end: float = 3.5
    """A line ends early if it leaves this much space: the next word would have fitted."""

    figure_gap: float = 2.0
    """Parts of a figure lie nearer to each other, in units."""
    least_part: float = 2.0
    """Figures and noise are larger, in units; less is a speck."""
    most_parts: int = 60
    """Figures, rules and noise of a page; of more, which is dirt, the smaller ones are left out."""
    least_stroke: float = 2.5
    """A figure has a component of this size, in units."""
    least_rule: float = 6.0
    """Shorter rules are dashes, in units."""

    least_picture: float = 0.06
    """Figures of this share of the page's area have what is printed in them; signatures and stamps are smaller."""
    scrap_components: int = 6
    """Unread print of at most this many glyphs within a figure is part of it. Elsewhere it may be a piece of a
    signature or a stamp, ..."""
    scrap_gap: tuple[float, float] = (0.6, 0.5)
    """... and belongs to the next piece if both, enlarged by this across and down in units, meet."""
    least_noise: float = 4.0
    """Noise is larger, in units; less is dirt."""
    most_noise: int = 12
    """Of more noise on a page the smaller is left out, too."""
    rule_gap: float = 5.0
    """Pieces of one rule are no farther apart, in units."""
    trimmed_share: float = 0.5
    """A figure whose upper part crosses a line of print begins below it, if this share of its height is left."""
    largest_scrap: float = 40.0
    """Longer parts, in units, are not scraps but borders or pictures."""

    sure_confidence: float = 0.5
    """A line read with more is text, however it looks."""
    long_line: int = 8
    """Number of components on a straight baseline that proves a text line."""
    least_em_px: float = 6.0
    """Smaller print on the working copy is noise, since it is not readable."""
    few: int = 3
    """On dirty pages lines with fewer components need words."""
    size_range: tuple[float, float] = (0.6, 1.7)
    """Short lines have sizes within this range of those of a long or read line."""
    dirt_share: float = 1.0
    """Loose components round a short line, against its own: more is dirt."""
    border_figure: tuple[float, float] = (0.5, 6.0)
    """Ink at the border of the page is a figure if it fills this share of its box and is at most this elongated."""
