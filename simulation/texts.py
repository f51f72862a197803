"""Words to set: openings of books long in the public domain."""

MOBY_DICK = (
    "Call me Ishmael. Some years ago, never mind how long precisely, having little or no money in my "
    "purse, and nothing particular to interest me on shore, I thought I would sail about a little and see "
    "the watery part of the world. It is a way I have of driving off the spleen and regulating the "
    "circulation.",
    "Whenever I find myself growing grim about the mouth; whenever it is a damp, drizzly November in my "
    "soul; whenever I find myself involuntarily pausing before coffin warehouses, and bringing up the "
    "rear of every funeral I meet; and especially whenever my hypos get such an upper hand of me, that it "
    "requires a strong moral principle to prevent me from deliberately stepping into the street, and "
    "methodically knocking people's hats off, then, I account it high time to get to sea as soon as I "
    "can.",
    "This is my substitute for pistol and ball. With a philosophical flourish Cato throws himself upon "
    "his sword; I quietly take to the ship. There is nothing surprising in this. If they but knew it, "
    "almost all men in their degree, some time or other, cherish very nearly the same feelings towards "
    "the ocean with me.",
)

PRIDE_AND_PREJUDICE = (
    "It is a truth universally acknowledged, that a single man in possession of a good fortune, must be "
    "in want of a wife. However little known the feelings or views of such a man may be on his first "
    "entering a neighbourhood, this truth is so well fixed in the minds of the surrounding families, that "
    "he is considered as the rightful property of some one or other of their daughters.",
    "My dear Mr. Bennet, said his lady to him one day, have you heard that Netherfield Park is let at "
    "last? Mr. Bennet replied that he had not. But it is, returned she; for Mrs. Long has just been here, "
    "and she told me all about it. Mr. Bennet made no answer. Do not you want to know who has taken it? "
    "cried his wife impatiently. You want to tell me, and I have no objection to hearing it. This was "
    "invitation enough.",
)

TWO_CITIES = (
    "It was the best of times, it was the worst of times, it was the age of wisdom, it was the age of "
    "foolishness, it was the epoch of belief, it was the epoch of incredulity, it was the season of "
    "Light, it was the season of Darkness, it was the spring of hope, it was the winter of despair, we "
    "had everything before us, we had nothing before us, we were all going direct to Heaven, we were all "
    "going direct the other way; in short, the period was so far like the present period, that some of "
    "its noisiest authorities insisted on its being received, for good or for evil, in the superlative "
    "degree of comparison only.",
    "There were a king with a large jaw and a queen with a plain face, on the throne of England; there "
    "were a king with a large jaw and a queen with a fair face, on the throne of France. In both "
    "countries it was clearer than crystal to the lords of the State preserves of loaves and fishes, that "
    "things in general were settled for ever.",
)

ALICE = (
    "Alice was beginning to get very tired of sitting by her sister on the bank, and of having nothing to "
    "do: once or twice she had peeped into the book her sister was reading, but it had no pictures or "
    "conversations in it, and what is the use of a book, thought Alice, without pictures or "
    "conversations?",
    "So she was considering in her own mind, as well as she could, for the hot day made her feel very "
    "sleepy and stupid, whether the pleasure of making a daisy-chain would be worth the trouble of "
    "getting up and picking the daisies, when suddenly a White Rabbit with pink eyes ran close by her.",
    "There was nothing so very remarkable in that; nor did Alice think it so very much out of the way to "
    "hear the Rabbit say to itself, Oh dear! Oh dear! I shall be late! But when the Rabbit actually took "
    "a watch out of its waistcoat-pocket, and looked at it, and then hurried on, Alice started to her "
    "feet.",
)

WALDEN = (
    "When I wrote the following pages, or rather the bulk of them, I lived alone, in the woods, a mile "
    "from any neighbor, in a house which I had built myself, on the shore of Walden Pond, in Concord, "
    "Massachusetts, and earned my living by the labor of my hands only. I lived there two years and two "
    "months. At present I am a sojourner in civilized life again.",
    "I should not obtrude my affairs so much on the notice of my readers if very particular inquiries had "
    "not been made by my townsmen concerning my mode of life, which some would call impertinent, though "
    "they do not appear to me at all impertinent, but, considering the circumstances, very natural and "
    "pertinent. Some have asked what I got to eat; if I did not feel lonesome; if I was not afraid; and "
    "the like.",
    "I went to the woods because I wished to live deliberately, to front only the essential facts of "
    "life, and see if I could not learn what it had to teach, and not, when I came to die, discover that "
    "I had not lived.",
)
