"""The same plain sentences in ten languages of seven scripts, written for this project."""

from dataclasses import dataclass
from typing import Literal

Script = Literal["Latin", "Cyrillic", "Greek", "Arabic", "Devanagari", "Japanese", "Chinese"]


@dataclass(frozen=True, slots=True)
class LanguageText:
    """A heading and paragraphs in one language; `name` is Tesseract's (ISO 639-2/T)."""

    name: str
    script: Script
    heading: str
    paragraphs: tuple[str, ...]

    @property
    def spaced(self) -> bool:
        """Whether words have spaces between them."""
        return self.script not in ("Japanese", "Chinese")


TEXTS = (
    LanguageText(
        "fra",
        "Latin",
        "L'eau et la montagne",
        (
            "L'eau couvre environ soixante-dix pour cent de la surface de la Terre. La plus grande partie est salée "
            "et remplit les mers; seule une petite part est douce et se trouve dans les fleuves, les lacs et la glace.",
            "En été, beaucoup de familles vont à la côte pour nager et se reposer. Au printemps, la neige fond dans "
            "les montagnes et nourrit les ruisseaux. Un fleuve naît d'une petite source et grandit jusqu'à la mer.",
            "Le canal de Suez fut ouvert en 1869; il mesure aujourd'hui 193 kilomètres. Les arbres retiennent le sol "
            "et donnent de l'ombre. Les abeilles visitent les fleurs et font du miel. En hiver, les nuits sont "
            "longues et l'on voit bien les étoiles.",
        ),
    ),
    LanguageText(
        "deu",
        "Latin",
        "Wasser und Gebirge",
        (
            "Wasser bedeckt etwa siebzig Prozent der Erdoberfläche. Das meiste davon ist salzig und füllt die Meere; "
            "nur ein kleiner Teil ist süß und liegt in Flüssen, in Seen und im Eis.",
            "Im Sommer fahren viele Familien an die Küste, um zu schwimmen und sich zu erholen. Im Frühling schmilzt "
            "der Schnee in den Bergen und nährt die Bäche. Ein Fluss beginnt als Quelle und wächst bis zum Meer.",
            "Der Sueskanal wurde 1869 eröffnet; heute ist er 193 Kilometer lang. Bäume halten den Boden fest und geben "
            "Schatten. Bienen besuchen die Blüten und machen Honig. Im Winter sind die Nächte lang, und man sieht die "
            "Sterne gut.",
        ),
    ),
    LanguageText(
        "spa",
        "Latin",
        "El agua y la montaña",
        (
            "El agua cubre cerca del setenta por ciento de la superficie de la Tierra. La mayor parte es salada y "
            "llena los mares; solo una pequeña parte es dulce y se halla en los ríos, los lagos y el hielo.",
            "En verano muchas familias van a la costa para nadar y descansar. En primavera la nieve se funde en las "
            "montañas y alimenta los arroyos. Un río nace de una pequeña fuente y crece hasta llegar al mar.",
            "El canal de Suez se abrió en 1869; hoy mide 193 kilómetros. Los árboles sujetan el suelo y dan sombra. "
            "Las abejas visitan las flores y hacen miel. En invierno las noches son largas y se ven las estrellas.",
        ),
    ),
    LanguageText(
        "pol",
        "Latin",
        "Woda i góry",
        (
            "Woda pokrywa około siedemdziesięciu procent powierzchni Ziemi. Większość z niej jest słona i wypełnia "
            "morza; tylko mała część jest słodka i znajduje się w rzekach, jeziorach i lodzie.",
            "Latem wiele rodzin jedzie nad morze, aby pływać i odpoczywać. Wiosną śnieg w górach topnieje i zasila "
            "strumienie. Rzeka zaczyna się jako małe źródło i rośnie w drodze do morza.",
            "Kanał Sueski otwarto w 1869 roku; dziś ma 193 kilometry długości. Drzewa trzymają glebę i dają cień. "
            "Pszczoły odwiedzają kwiaty i robią miód. Zimą noce są długie i dobrze widać gwiazdy.",
        ),
    ),
    LanguageText(
        "rus",
        "Cyrillic",
        "Вода и горы",
        (
            "Вода покрывает около семидесяти процентов поверхности Земли. Большая её часть солёная и наполняет моря; "
            "только малая часть пресная и находится в реках, озёрах и во льду.",
            "Летом многие семьи едут к морю, чтобы плавать и отдыхать. Весной снег в горах тает и питает ручьи. Река "
            "начинается маленьким родником и растёт по пути к морю.",
            "Суэцкий канал был открыт в 1869 году; сегодня его длина 193 километра. Деревья удерживают почву и дают "
            "тень. Пчёлы посещают цветы и делают мёд. Зимой ночи длинные, и хорошо видны звёзды.",
        ),
    ),
    LanguageText(
        "ell",
        "Greek",
        "Το νερό και τα βουνά",
        (
            "Το νερό καλύπτει περίπου το εβδομήντα τοις εκατό της επιφάνειας της Γης. Το μεγαλύτερο μέρος είναι αλμυρό "
            "και γεμίζει τις θάλασσες. Μόνο ένα μικρό μέρος είναι γλυκό και βρίσκεται στα ποτάμια, στις λίμνες και "
            "στον πάγο.",
            "Το καλοκαίρι πολλές οικογένειες πηγαίνουν στη θάλασσα για να κολυμπήσουν και να ξεκουραστούν. Την άνοιξη "
            "το χιόνι λιώνει στα βουνά και τρέφει τα ρυάκια. Ένα ποτάμι αρχίζει ως μικρή πηγή και μεγαλώνει ως τη "
            "θάλασσα.",
            "Η διώρυγα του Σουέζ άνοιξε το 1869. Σήμερα έχει μήκος 193 χιλιόμετρα. Τα δέντρα κρατούν το χώμα και "
            "δίνουν σκιά. Οι μέλισσες επισκέπτονται τα λουλούδια και κάνουν μέλι. Τον χειμώνα οι νύχτες είναι μεγάλες.",
        ),
    ),
    LanguageText(
        "ara",
        "Arabic",
        "الماء والجبال",
        (
            "يغطي الماء نحو سبعين في المئة من سطح الأرض. معظم هذا الماء مالح ويملأ البحار، والقليل منه عذب ويوجد في "
            "الأنهار والبحيرات والجليد.",
            "في الصيف تسافر عائلات كثيرة إلى الساحل للسباحة والراحة. وفي الربيع يذوب الثلج في الجبال ويغذي الجداول. "
            "يبدأ النهر من نبع صغير ويكبر في طريقه إلى البحر.",
            "الأشجار تحفظ التربة وتعطي الظل. يزور النحل الزهور ويصنع العسل. في الشتاء تكون الليالي طويلة وتظهر النجوم "
            "بوضوح. يحب الناس الجلوس في البيت وقراءة الكتب وشرب الشاي مع الأصدقاء والجيران.",
        ),
    ),
    LanguageText(
        "hin",
        "Devanagari",
        "पानी और पहाड़",
        (
            "पृथ्वी की सतह का लगभग सत्तर प्रतिशत भाग पानी से ढका है। इसका अधिकांश भाग खारा है और समुद्रों में है। केवल थोड़ा सा पानी "
            "मीठा है और नदियों, झीलों तथा बर्फ में मिलता है।",
            "गर्मियों में बहुत से परिवार समुद्र के किनारे जाते हैं, जहाँ वे तैरते और आराम करते हैं। वसंत में पहाड़ों की बर्फ पिघलती है और "
            "नालों में पानी भर जाता है। नदी एक छोटे से सोते से निकलती है और समुद्र तक जाते हुए बड़ी होती जाती है।",
            "पेड़ मिट्टी को पकड़ कर रखते हैं और छाया देते हैं। मधुमक्खियाँ फूलों पर जाती हैं और शहद बनाती हैं। सर्दियों में रातें लंबी होती "
            "हैं और तारे साफ दिखाई देते हैं।",
        ),
    ),
    LanguageText(
        "jpn",
        "Japanese",
        "水と山",
        (
            "水は地球の表面の約七十パーセントを覆っています。その大部分は海の塩水で、川や湖や氷にある真水はごくわずかです。",
            "夏になると、多くの家族が海岸へ行き、泳いだり休んだりします。春には山の雪がとけて、小川の水が増えます。"
            "川は小さな泉から始まり、海へ向かって流れながら大きくなります。",
            "木は土を守り、日かげを作ります。みつばちは花を訪れて、はちみつを作ります。冬の夜は長く、星がよく見えます。"
            "人々は家の中で本を読み、友だちとお茶を飲みます。",
        ),
    ),
    LanguageText(
        "chi_sim",
        "Chinese",
        "水与山",
        (
            "水覆盖了地球表面的大约百分之七十。其中大部分是海洋里的咸水，只有很少一部分是淡水，存在于河流、湖泊和冰雪之中。",
            "夏天，许多家庭到海边去游泳和休息。春天，山上的雪融化了，小溪的水变多了。河流从一个小小的泉眼开始，"
            "流向大海，越来越宽。",
            "树木保护土壤，也给人们带来阴凉。蜜蜂飞到花上采蜜。冬天的夜晚很长，天上的星星看得很清楚。人们在家里读书，"
            "和朋友一起喝茶，谈论过去的一年。",
        ),
    ),
)
