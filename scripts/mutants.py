"""Where C sources can be mutated: reads functions, finds the types of their expressions, and marks every term and factor.

A site is a part of an expression whose value x is replaced by a x + b, with a and b from two arrays: 1 and 0 unless a
mutant says otherwise. Terms have the mutants `flip` (-1, 0) and `drop` (0, 0), factors `one` (0, 1), and calls of adjoints
are left out by `drop`."""
import re

TOKEN = re.compile(r"\s+|//[^\n]*|/\*.*?\*/|#(?:[^\n]*\\\n)*[^\n]*|\"(?:\\.|[^\"])*\"|[A-Za-z_]\w*|"
                   r"(?:0x[\da-fA-F.p+-]+|\d*\.?\d+(?:[eE][+-]?\d+)?\.?)[fuUlL]*|->|\+\+|--|<<=?|>>=?|[-+*/|&=!<>]=|&&|\|\||.", re.S)
HEADER = re.compile(r"^(?:KFN|static(?: inline)?(?: NOINLINE)?|rey_result)(?: const)? ?(\w*) ?(\*?)(\w+)\(", re.M)
STRUCT = re.compile(r"^typedef struct \w* ?\{(.*?)^\} (\w+);", re.M | re.S)
BINARY = [["||"], ["&&"], ["|"], ["^"], ["&"], ["==", "!="], ["<", ">", "<=", ">="], ["<<", ">>"], ["+", "-"],
          ["*", "/", "%"]]
ASSIGN = {"=", "+=", "-=", "*=", "/=", "|=", "&="}
NUMBERS = {"Float", "real", "float", "double"}
MUTABLE = NUMBERS | {"Vec3", "Spec"}
# What a function makes a sum or a product of its arguments: their numbers.
SUMS = {"v3_add": (0, 1), "v3_sub": (0, 1), "spec_add": (0, 1), "spec_sub": (0, 1), "v3_madd": (0, 1), "spec_madd": (0, 1)}
PRODUCTS = {"v3_scale": (1,), "spec_scale": (1,), "spec_mul": (0, 1), "v3_madd": (1,), "spec_madd": (1,)}
# Arguments that are added up, by function: the last but `back` one.
ADDED = {"v3_acc": 1, "spec_acc": 1, "sink_add": 2, "sink_add_uniform": 2, "camera_add": 2, "light_place_adj": 3,
         "f_scatter_add": 2}
# Decisions and numbers of things: nothing in them is mutated.
OPAQUE = re.compile(r"m_|mi_|i_|u_|rng_|UNUSED|assert|memcpy|memset|SHAPE_FIELD|EMITTER_FIELD|LOAD_|KEEP_")


class Node:
    def __init__(self, begin, end, kind, parts=(), type=None, name=""):
        self.begin, self.end, self.kind, self.parts, self.type, self.name = begin, end, kind, list(parts), type, name


class Source:
    """Types of the structs' fields and of what functions return, from all sources; pointers and arrays end in `*`."""

    def __init__(self, texts):
        self.fields, self.returns = {}, {}
        for text in texts:
            for body, name in STRUCT.findall(text):
                own = self.fields.setdefault(name, {})
                for line in re.sub(r"//[^\n]*", "", body).split(";"):
                    m = re.match(r"\s*(?:const )?(\w+) (.*)", line, re.S)
                    for stars, field, array in re.findall(r"(\*?)(\w+)(\[)?[^,]*", m[2]) if m else ():
                        own[field] = m[1] + "*" * (len(stars) + len(array))
            for m in HEADER.finditer(text):
                self.returns[m[3]] = m[1] + m[2]


def pointed(type):
    """What a pointer or an array of that type holds."""
    return type[:-1] if type and type.endswith("*") else None


class Parser:
    """Reads the statements of one function; `tokens` are (text, begin, end)."""

    def __init__(self, tokens, source, symbols):
        self.tokens, self.at, self.source, self.symbols = tokens, 0, source, symbols

    def peek(self, ahead=0):
        return self.tokens[self.at + ahead][0] if self.at + ahead < len(self.tokens) else ""

    def take(self, text=None):
        if text is not None and self.peek() != text:
            raise SyntaxError(f"{self.peek()} where {text} should be")
        self.at += 1
        return self.tokens[self.at - 1]

    def member(self, base, name):
        return self.source.fields.get((base or "").rstrip("*"), {}).get(name)

    def list_until(self, close):
        parts = []
        while self.peek() != close:
            if self.peek() == "." and self.peek(2) == "=":
                self.at += 3
            parts.append(self.list_braced() if self.peek() == "{" else self.ternary())
            if self.peek() == ",":
                self.take()
        return parts, self.take(close)[2]

    def list_braced(self):
        begin = self.take("{")[1]
        parts, end = self.list_until("}")
        return Node(begin, end, "list", parts)

    def primary(self):
        text, begin, end = self.take()
        if text == "(":
            cast = re.fullmatch(r"[A-Za-z_]\w*", self.peek()) and self.peek(1) in (")", "*") and \
                (self.peek() in self.source.fields or self.peek() in MUTABLE or re.match(r"u?int\d+_t|size_t|Int|UInt|Mask|int|bool", self.peek()))
            if cast:
                type = self.take()[0]
                while self.peek() != ")":
                    type += self.take()[0]
                self.take()
                if self.peek() == "{":
                    inner = self.list_braced()
                    return Node(begin, inner.end, "list", inner.parts, type)
                inner = self.unary()
                return Node(begin, inner.end, "cast", [inner], type)
            inner = self.ternary()
            return Node(begin, self.take(")")[2], "group", [inner], inner.type)
        if re.match(r"[A-Za-z_]", text):
            return Node(begin, end, "name", (), self.symbols.get(text), text)
        if re.match(r"[\d.]", text):
            return Node(begin, end, "number", (), "Float" if re.search(r"[.fe]", text) and "0x" not in text else None, text)
        if text.startswith('"'):
            return Node(begin, end, "text")
        raise SyntaxError(text)

    def unary(self):
        if self.peek() in ("-", "+", "!", "~", "*", "&", "++", "--"):
            text, begin, _ = self.take()
            inner = self.unary()
            type = {"-": inner.type, "+": inner.type, "*": pointed(inner.type)}.get(text)
            return Node(begin, inner.end, "unary" + text, [inner], type)
        node = self.primary()
        while self.peek() in ("(", "[", ".", "->", "++", "--"):
            text = self.take()[0]
            if text == "(":
                parts, end = self.list_until(")")
                node = Node(node.begin, end, "call", parts, self.source.returns.get(node.name), node.name)
            elif text == "[":
                self.ternary()
                node = Node(node.begin, self.take("]")[2], "index", (), pointed(node.type))
            elif text in ("++", "--"):
                node = Node(node.begin, self.tokens[self.at - 1][2], "name")
            else:
                name, _, end = self.take()
                node = Node(node.begin, end, "name", (), self.member(node.type, name))
        return node

    def binary(self, level):
        if level == len(BINARY):
            return self.unary()
        parts, operators = [self.binary(level + 1)], []
        while self.peek() in BINARY[level]:
            operators.append(self.take()[0])
            parts.append(self.binary(level + 1))
        if not operators:
            return parts[0]
        kind = {8: "sum", 9: "product"}.get(level, "opaque")
        types = [part.type for part in parts]
        type = next((t for t in ("Float", "real", "float", "double") if t in types), None) if kind != "opaque" else None
        return Node(parts[0].begin, parts[-1].end, "opaque" if "%" in operators else kind, parts, type)

    def ternary(self):
        node = self.binary(0)
        if self.peek() != "?":
            return node
        self.take()
        one = self.ternary()
        self.take(":")
        other = self.ternary()
        return Node(node.begin, other.end, "choice", [one, other], one.type)


def is_trivial(node):
    """Zeros change with no sign, and a factor 1 by nothing."""
    while node.kind == "cast" or (node.name == "f_set" and node.parts):
        node = node.parts[0]
    return re.match(r"\w*(zero|light_move_zero)$", node.name) or (node.kind == "number" and float(node.name.rstrip("fuUlL")) in (0, 1))


class Finder:
    """Collects the sites of one function: type and mutants by (begin, end)."""

    def __init__(self):
        self.sites = {}

    def site(self, node, mutants, type=None):
        type = node.type or type
        if type in MUTABLE and node.kind != "list" and not is_trivial(node):
            shared = "Float" if type == "real" else type
            _, own = self.sites.setdefault((node.begin, node.end), (shared, []))
            own += [mutant for mutant in mutants if mutant not in own]

    def grows(self, node):
        """The terms of x in x = x + e, but for the first one."""
        for part in node.parts[1:2] if node.kind == "call" else node.parts[1:]:
            self.term_of_sum(part, node.type)
            if node.name.endswith("madd"):
                self.factor_alone(part)
        for part in node.parts[2:] if node.kind == "call" else ():
            self.inside(part)

    def term(self, node, drop):
        """What stands alone, or is added to something."""
        inner = node
        while inner.kind in ("group", "cast"):
            inner = inner.parts[0]
        if inner.kind != "sum" and inner.name not in SUMS:
            self.site(node, ["flip", "drop"] if drop else ["flip"])
        self.inside(node)

    def inside(self, node):
        if node.kind == "opaque" or (node.kind == "call" and OPAQUE.match(node.name)):
            return
        type = node.type if node.type in MUTABLE else None
        for number, part in enumerate(node.parts):
            if node.kind == "sum" and type:
                self.term_of_sum(part, type)
            elif node.kind == "product" and type:
                self.factor(part, type)
            elif node.name in SUMS and number in SUMS[node.name]:
                self.term_of_sum(part, None)
                if number in PRODUCTS.get(node.name, ()):
                    self.factor_alone(part)
            elif number in PRODUCTS.get(node.name, ()):
                self.factor(part, None)
            else:
                self.inside(part)

    def term_of_sum(self, node, type):
        self.site(node, ["flip", "drop"], type)
        self.inside(node)

    def factor_alone(self, node):
        if node.kind not in ("product", "number"):
            self.site(node, ["one"])

    def factor(self, node, type):
        inner = node
        while inner.kind == "group" or inner.kind == "unary-":
            inner = inner.parts[0]
        if inner.kind != "product" and inner.name not in ("spec_mul", "spec_scale", "f_set"):
            self.site(node, ["one"], type)
        self.inside(node)


def statements(tokens):
    """Runs of tokens between the borders of statements; headers of loops and conditions are left out."""
    depth, run, skip = 0, [], False
    for token in tokens:
        text = token[0]
        if not run and depth == 0 and text in ("if", "for", "while", "switch", "else", "do", "case", "default"):
            skip = text not in ("else", "do")
            closes = ":" if text in ("case", "default") else ")"
            if not skip:
                continue
        run.append(token)
        depth += (text in "([") - (text in ")]") if len(text) == 1 else 0
        literal = text == "{" and len(run) > 1 and run[-2][0] in ("=", ")", ",", "{") and not skip
        if literal or (run and getattr(statements, "braces", 0)):
            statements.braces = getattr(statements, "braces", 0) + (text == "{") - (text == "}")
            continue
        if skip and depth == 0 and text == closes:
            run, skip = [], False
        elif depth == 0 and text in (";", "{", "}"):
            if text == ";" and len(run) > 1:
                yield run[:-1]
            run = []


def declarators(parser, type, finder):
    """The rest of a declaration after its type."""
    while parser.peek():
        pointer = False
        while parser.peek() in ("*", "const", "RESTRICT"):
            pointer = pointer or parser.take()[0] == "*"
        name, array = parser.take()[0], False
        while parser.peek() == "[":
            array = True
            while parser.take()[0] != "]":
                pass
        parser.symbols[name] = type + "*" * (pointer + array)
        if parser.peek() == "=":
            parser.take()
            node = parser.list_braced() if parser.peek() == "{" else parser.ternary()
            if pointer or array or node.kind == "list" or node.type not in MUTABLE:
                finder.inside(node) if not pointer else None
            else:
                finder.term(node, drop=False)
        if parser.peek() == ",":
            parser.take()
        elif parser.peek():
            raise SyntaxError(parser.peek())


def statement(tokens, source, symbols, finder):
    parser = Parser(tokens, source, symbols)
    if parser.peek() == "return":
        parser.take()
        node = parser.ternary()
        finder.term(node, drop=False)
        return
    while parser.peek() in ("const", "static"):
        parser.take()
    if re.match(r"[A-Za-z_]", parser.peek()) and re.match(r"[A-Za-z_]|\*$", parser.peek(1)) and parser.peek(1) != "->" and \
            (parser.peek(1) != "*" or parser.peek(3) in ("=", ",", "", "[")):
        declarators(parser, parser.take()[0], finder)
        return
    node = parser.ternary()
    if parser.peek() in ASSIGN:
        operator, left = parser.take()[0], node
        while True:
            node = parser.ternary()
            if parser.peek() != "=":
                break
            parser.take()
        texts = [[text for text, begin, _ in tokens if part.begin <= begin < part.end] for part in [left] + node.parts[:1]]
        if operator == "=" and (node.kind == "sum" or node.name in SUMS) and texts[0] == texts[-1]:
            finder.grows(node)
        elif operator in ("=", "+=", "-=") and left.type in MUTABLE:
            node.type = node.type or left.type
            finder.term(node, drop=operator != "=")
        else:
            finder.inside(node)
    elif node.kind == "call" and node.name in ADDED and len(node.parts) >= ADDED[node.name]:
        back = ADDED[node.name]
        for part in node.parts[:-back] + node.parts[len(node.parts) - back + 1:]:
            finder.inside(part)
        finder.term(node.parts[-back], drop=True)
    else:
        if node.kind == "call" and re.search(r"_adj|_flush$", node.name):
            finder.sites[node.begin, node.end] = ("call", ["drop"])
        finder.inside(node)
    if parser.peek():
        raise SyntaxError(parser.peek())


def tokens_of(text, begin, end):
    found = []
    for m in TOKEN.finditer(text, begin, end):
        if not (m[0].isspace() or m[0].startswith(("//", "/*", "#"))):
            found.append((m[0], m.start(), m.end()))
    return found


def functions(text, wanted):
    """(name, begin of the parameters, begin and end of the body) of the functions whose name matches."""
    for m in HEADER.finditer(text):
        brace, semicolon = text.find("{", m.end()), text.find(";", m.end())
        if brace < 0 or (0 <= semicolon < brace) or not re.fullmatch(wanted, m[3]):
            continue
        line_end = text.find("\n", brace)
        end = line_end if text[:line_end].endswith("}") else text.find("\n}", brace) + 1
        yield m[3], m.end(), brace + 1, end


def sites_of(text, source, wanted):
    """The sites of a file's functions, and how many statements could not be read."""
    found, unread = [], 0
    for name, parameters, begin, end in functions(text, wanted):
        symbols = {}
        for m in re.finditer(r"(\w+) (?:const )?(\**)(?:const )?(\w+)(\[)?", text[parameters:begin]):
            symbols[m[3]] = m[1] + m[2] + "*" * bool(m[4])
        finder = Finder()
        statements.braces = 0
        for run in statements(tokens_of(text, begin, end)):
            before = dict(finder.sites)
            try:
                statement(run, source, symbols, finder)
            except (SyntaxError, IndexError, ValueError):
                unread += 1
                finder.sites = before
        found += [(*span, *site, name) for span, site in sorted(finder.sites.items())]
    return found, unread


def wrapped(type, number, opening):
    """What stands before or behind an expression to make a site of it."""
    a, b = f"rey_times[{number}]", f"rey_plus[{number}]"
    if type == "call":
        return f"if ({a}) {{ " if opening else "; }"
    if type in NUMBERS:
        own = "real" if type == "Float" else type
        return f"(({own}){a} * (" if opening else f") + ({own}){b})"
    prefix = "v3" if type == "Vec3" else "spec"
    if opening:
        return f"{prefix}_scale((" if type == "Vec3" else "spec_add(spec_scale(("
    return f"), f_set((real){a}))" + ("" if type == "Vec3" else f", spec_set(f_set((real){b})))")


def rewrite(text, sites):
    """The text with sites (begin, end, type, number)."""
    edits = []
    for begin, end, type, number in sites:
        edits.append((begin, 1, -end, wrapped(type, number, True)))
        edits.append((end, 0, -begin, wrapped(type, number, False)))
    out, last = [], 0
    for position, _, _, insertion in sorted(edits):
        out += [text[last:position], insertion]
        last = position
    return "".join(out) + text[last:]
