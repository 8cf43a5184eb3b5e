"""Forces of one's own: a Python function, written with NumPy or with jax.numpy, as a formula of a scene.

    import numpy as np
    import pliant

    def seal(q, v, c=0.0, width=0.3):
        return -c * v * np.exp(-(q / width) ** 2)

    text += pliant.own.force("seal", seal, joint="elbow")
    model = pliant.loads(text)              # has the parameters seal.c and seal.width

The function is called once, with symbols in place of numbers; what it computes with them is written down as a formula, which the
engine evaluates with exact derivatives. So what it does must not depend on their values: `numpy.where` instead of `if`. Its arguments
are variables (q and v of a joint of one axis; qx, qy, qz, vx, vy, vz of a ball; x, y, z, vx, vy, vz of a node) and parameters of the
force. All in SI units.
"""

from __future__ import annotations

import inspect
import json
import math
import traceback
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

__all__ = ["force", "formula"]

AT_JOINTS = ("q", "v", "qx", "qy", "qz", "vx", "vy", "vz")
ON_NODES = ("x", "y", "z", "vx", "vy", "vz")
# How tightly a text binds: what stands inside one that binds more tightly needs brackets.
COMPARISON, SUM, PRODUCT, SIGNED, POWER, ATOM = range(6)
KNOWN = (
    "sin cos tan arcsin arccos arctan arctan2 sinh cosh tanh exp expm1 log log1p sqrt abs sign hypot minimum maximum where".split()
)
SAME = "sin cos tan arcsin arccos arctan sinh cosh tanh exp expm1 log log1p sqrt sign".split()


class Symbol:
    """A number that is not known yet, as the text of a formula."""

    def __init__(self, text: str, level: int = ATOM):
        self.text, self.level = text, level

    def __repr__(self) -> str:
        return f"Symbol({self.text})"

    def within(self, level: int) -> str:
        """The text as a part of something that binds like `level`."""
        return self.text if self.level >= level else f"({self.text})"

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        if method != "__call__" or kwargs:
            raise unsupported(f"numpy.{ufunc.__name__}.{method}" if method != "__call__" else f"numpy.{ufunc.__name__} with options")
        return each(ufunc.__name__, *inputs)

    def __array_function__(self, function: Any, types: Any, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        if function is np.where and len(args) == 3:
            return each("where", *args)
        if function is np.clip and not set(kwargs) - {"a_min", "a_max", "min", "max"}:
            low, high = [*args[1:], *kwargs.values()] if len(args) + len(kwargs) == 3 else (None, None)
            return each("minimum", each("maximum", args[0], low), high)
        raise unsupported(f"numpy.{function.__name__}")

    def __bool__(self) -> bool:
        raise TypeError(IF)

    def __float__(self) -> float:
        raise TypeError("a function of the module `math` takes numbers only. fix: write `numpy.sin` for `math.sin`, and so on")

    __int__ = __index__ = __float__  # type: ignore[assignment]
    __hash__ = object.__hash__

    def __eq__(self, other: object) -> bool:
        raise TypeError("values are compared for equality. fix: compare with `<`, `<=`, `>` or `>=`, in `numpy.where`")

    __ne__ = __eq__

    def __pos__(self) -> Symbol:
        return self

    def __round__(self, digits: int | None = None) -> Symbol:
        raise unsupported("round")

    def __mod__(self, other: object) -> Symbol:
        raise unsupported("the remainder `%`")

    def __floordiv__(self, other: object) -> Symbol:
        raise unsupported("the division `//`")


IF = (
    "what the function does depends on a value (`if`, `and`, `or`, `while`, `max` or `min` of Python). fix: write "
    "`numpy.where(condition, a, b)` for `a if condition else b`, `numpy.maximum` for `max`, `&` for `and`"
)


def _operators() -> None:
    """Python's operators as the functions that NumPy has for them."""
    names = {
        "add": "add", "sub": "subtract", "mul": "multiply", "truediv": "divide", "pow": "power", "and": "logical_and", "or": "logical_or",
    }  # fmt: skip
    for name, function in names.items():
        setattr(Symbol, f"__{name}__", lambda a, b, f=function: elementwise(f, a, b))
        setattr(Symbol, f"__r{name}__", lambda a, b, f=function: elementwise(f, b, a))
    for name, function in {"lt": "less", "le": "less_equal", "gt": "greater", "ge": "greater_equal"}.items():
        setattr(Symbol, f"__{name}__", lambda a, b, f=function: elementwise(f, a, b))
    for name, function in {"neg": "negative", "abs": "absolute", "invert": "logical_not"}.items():
        setattr(Symbol, f"__{name}__", lambda a, f=function: apply(f, a))
    for name in [*SAME, "square", "reciprocal"]:  # what NumPy calls for arrays of objects
        setattr(Symbol, name, lambda a, f=name: apply(f, a))


def elementwise(name: str, a: Any, b: Any) -> Any:
    """An operator between a symbol and a number, a symbol, or an array of either; of anything else Python decides."""
    known = all(isinstance(x, (Symbol, int, float, np.number, np.bool_, np.ndarray)) for x in (a, b))
    return each(name, a, b) if known else NotImplemented


def symbol(x: Any) -> Symbol:
    """A number as a symbol."""
    if isinstance(x, Symbol):
        return x
    value = float(x)
    if not math.isfinite(value):
        raise ValueError(f"the formula contains {value}. fix: compute with finite numbers")
    text = repr(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
    return Symbol(text, SIGNED if text.startswith("-") else ATOM)


def call(name: str, *of: Symbol) -> Symbol:
    return Symbol(f"{name}({', '.join(x.text for x in of)})")


def infix(sign: str, a: Symbol, b: Symbol, level: int) -> Symbol:
    """`a sign b`: the right one binds more tightly, so that it is evaluated as it was written."""
    space = " " if level <= SUM else ""
    return Symbol(f"{a.within(level)}{space}{sign}{space}{b.within(level + 1)}", level)


def power(a: Symbol, b: Symbol) -> Symbol:
    return Symbol(f"{a.within(ATOM)}**{b.within(ATOM)}", POWER)


def scaled(factor: float) -> Callable[[Symbol], Symbol]:
    return lambda x: infix("*", symbol(factor), x, PRODUCT)


ONE = Symbol("1")
FUNCTIONS: dict[str, Callable[..., Symbol]] = {
    **{name: lambda x, f=name: call(f, x) for name in SAME},
    **{name: lambda a, b, f=name: call(f, a, b) for name in ("arctan2", "hypot", "minimum", "maximum")},
    "where": lambda c, a, b: call("where", c, a, b),
    "add": lambda a, b: infix("+", a, b, SUM),
    "subtract": lambda a, b: infix("-", a, b, SUM),
    "multiply": lambda a, b: infix("*", a, b, PRODUCT),
    "divide": lambda a, b: infix("/", a, b, PRODUCT),
    "power": power,
    "float_power": power,
    "negative": lambda x: Symbol(f"-{x.within(SIGNED)}", SIGNED),
    "positive": lambda x: x,
    "absolute": lambda x: call("abs", x),
    "fabs": lambda x: call("abs", x),
    "fmin": lambda a, b: call("minimum", a, b),
    "fmax": lambda a, b: call("maximum", a, b),
    "square": lambda x: power(x, Symbol("2")),
    "reciprocal": lambda x: infix("/", ONE, x, PRODUCT),
    "less": lambda a, b: infix("<", Symbol(a.within(SUM), SUM), b, COMPARISON),
    "less_equal": lambda a, b: infix("<=", Symbol(a.within(SUM), SUM), b, COMPARISON),
    "greater": lambda a, b: infix(">", Symbol(a.within(SUM), SUM), b, COMPARISON),
    "greater_equal": lambda a, b: infix(">=", Symbol(a.within(SUM), SUM), b, COMPARISON),
    "logical_and": lambda a, b: infix("*", a, b, PRODUCT),
    "logical_or": lambda a, b: call("maximum", a, b),
    "logical_not": lambda a: infix("-", ONE, a, SUM),
    "bitwise_and": lambda a, b: infix("*", a, b, PRODUCT),
    "bitwise_or": lambda a, b: call("maximum", a, b),
    "invert": lambda a: infix("-", ONE, a, SUM),
    "exp2": lambda x: call("exp", scaled(math.log(2.0))(x)),
    "log2": lambda x: infix("/", call("log", x), symbol(math.log(2.0)), PRODUCT),
    "log10": lambda x: infix("/", call("log", x), symbol(math.log(10.0)), PRODUCT),
    "deg2rad": scaled(math.pi / 180.0),
    "radians": scaled(math.pi / 180.0),
    "rad2deg": scaled(180.0 / math.pi),
    "degrees": scaled(180.0 / math.pi),
}
_operators()


def unsupported(what: str) -> ValueError:
    return ValueError(f"{what} has no place in a formula. fix: write it with `+ - * / **`, comparisons, clip and {', '.join(KNOWN)}")


def apply(name: str, *of: Any) -> Symbol:
    """One of FUNCTIONS, of symbols and numbers."""
    if name not in FUNCTIONS:
        raise unsupported(f"numpy.{name}")
    return FUNCTIONS[name](*(symbol(x) for x in of))


def each(name: str, *of: Any) -> Any:
    """One of FUNCTIONS, element by element of arrays of symbols and numbers; a symbol of symbols."""
    # a symbol that stood beside an array would be asked for the function again
    arrays = [np.array(x, dtype=object) if isinstance(x, Symbol) else np.asarray(x) for x in of]
    return np.frompyfunc(lambda *x: apply(name, *x), len(of), 1)(*arrays)


def formula(function: Callable[..., Any]) -> str | list[str]:
    """The formula that a function of numbers computes, or the formulas where it returns several; its arguments are their names.

    The function may be written with NumPy or with jax.numpy. Errors name what no formula can have, and what to write instead:
    ValueError for a function or a number, TypeError where what it does depends on a value.
    """
    names = list(inspect.signature(function).parameters)
    try:
        result = function(*(Symbol(name) for name in names))
    except (TypeError, ValueError) as error:
        if not _came_from_jax(error):
            raise
        return _of_jax(function, names)
    return _texts(result)


def _texts(result: Any) -> str | list[str]:
    if isinstance(result, np.ndarray) and result.ndim == 0:
        result = result.item()
    if isinstance(result, (list, tuple, np.ndarray)):
        return [symbol(x).text for x in result]
    if result is None:
        raise ValueError("the function returns nothing. fix: `return` the force, or a list of three")
    return symbol(result).text


def force(
    name: str,
    function: Callable[..., Any],
    *,
    joint: str | None = None,
    rope: str | None = None,
    cloth: str | None = None,
    nodes: Sequence[int] | None = None,
    parameters: Mapping[str, float] | None = None,
) -> str:
    """A `[[force]]` table, to be appended to the text of a scene: what `function` returns acts at a joint, or on nodes of a rope or cloth.

    Arguments of the function that are no variables are parameters of the force; their values are those of `parameters`, else the
    function's defaults. One that is 0 is what a diagnosis looks for. The function returns one force, or three of a ball joint and of nodes;
    of nodes without a list they are per length of the rope or area of the cloth. The scene's reader checks the rest. Errors as of
    :func:`formula`, and ValueError for an argument without a value.
    """
    if sum(place is not None for place in (joint, rope, cloth)) != 1:
        raise ValueError("a force acts at one place. fix: give one of joint, rope and cloth")
    variables = AT_JOINTS if joint is not None else ON_NODES
    given, values = dict(parameters or {}), {}
    for argument in inspect.signature(function).parameters.values():
        if argument.name in variables:
            continue
        value = given.pop(argument.name, argument.default)
        if value is inspect.Parameter.empty:
            fix = f"give it in `parameters`, or name one of {', '.join(variables)}"
            raise ValueError(f"the argument `{argument.name}` has no value and is no variable. fix: {fix}")
        values[argument.name] = float(value)
    if given:
        raise ValueError(f"`parameters` has {', '.join(given)}, which is no argument of the function. fix: remove it, or add the argument")
    text = formula(function)
    place = [(key, value) for key, value in (("joint", joint), ("rope", rope), ("cloth", cloth)) if value is not None]
    lines = ["", "[[force]]", f"name = {json.dumps(name)}", *(f"{key} = {json.dumps(value)}" for key, value in place)]
    if nodes is not None:
        lines.append(f"nodes = {[int(node) for node in nodes]}")
    lines.append(f"formula = {json.dumps(text)}")
    if values:
        lines.append("parameters = { " + ", ".join(f"{key} = {value!r}" for key, value in values.items()) + " }")
    return "\n".join(lines) + "\n"


# ── JAX ──

ELEMENTWISE = {
    "add": "add", "sub": "subtract", "mul": "multiply", "div": "divide", "neg": "negative", "pow": "power", "max": "maximum",
    "min": "minimum", "abs": "absolute", "asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2", "lt": "less",
    "le": "less_equal", "gt": "greater", "ge": "greater_equal", "and": "logical_and", "or": "logical_or", "not": "logical_not",
    "square": "square", "exp2": "exp2", **{name: name for name in SAME},
}  # fmt: skip
INLINED = ("pjit", "jit", "closed_call", "core_call", "custom_jvp_call", "custom_vjp_call", "remat", "checkpoint")
UNCHANGED = ("convert_element_type", "stop_gradient", "copy", "reduce_precision")


def _came_from_jax(error: Exception) -> bool:
    """Whether JAX refused a symbol: then the function is written with it."""
    frames = (frame for frame, _ in traceback.walk_tb(error.__traceback__))
    modules = (frame.f_globals.get("__name__", "") for frame in frames)
    # JAX may hide its own frames, and then says so
    return any(name.split(".")[0] == "jax" for name in modules) or "jax" in str(error).lower()


def _of_jax(function: Callable[..., Any], names: list[str]) -> str | list[str]:
    """The formulas of a function written with jax.numpy, by way of its jaxpr in 64 bits."""
    import jax

    shape: list[Any] = []

    def flat(*at: Any) -> Any:
        result = function(*at)
        shape.append(result)
        return result

    try:
        with jax.enable_x64(True):
            program = jax.make_jaxpr(flat)(*(np.float64(1.0) for _ in names))
    except jax.errors.ConcretizationTypeError as error:
        raise TypeError(IF.replace("numpy.", "jax.numpy.")) from error
    out = _run(program.jaxpr, program.consts, [np.array(Symbol(name), dtype=object) for name in names])
    if isinstance(shape[-1], (list, tuple)):
        return [_single(x) for x in out]
    return _texts(out[0])


def _single(x: Any) -> str:
    return symbol(np.asarray(x, dtype=object).reshape(()).item()).text


def _objects(x: Any) -> Any:
    """A number or an array of numbers as an array of symbols."""
    return np.frompyfunc(symbol, 1, 1)(np.asarray(x)) if np.ndim(x) else np.array(symbol(np.asarray(x).item()), dtype=object)


def _run(jaxpr: Any, consts: Sequence[Any], args: Sequence[Any]) -> list[Any]:
    """The outputs of a jaxpr for arrays of symbols."""
    known = dict(zip(jaxpr.constvars, map(_objects, consts), strict=True)) | dict(zip(jaxpr.invars, args, strict=True))
    read = lambda x: _objects(x.val) if hasattr(x, "val") else known[x]
    for equation in jaxpr.eqns:
        out = _equation(equation, [read(x) for x in equation.invars])
        known.update(zip(equation.outvars, out, strict=True))
    return [read(x) for x in jaxpr.outvars]


def _equation(equation: Any, of: list[Any]) -> list[Any]:
    name, params = equation.primitive.name, equation.params
    if name in INLINED and params.get("name") == "hypot":  # what JAX makes of it asks for infinities
        return [each("hypot", *of)]
    if name in INLINED:
        inner = params.get("jaxpr") or params.get("call_jaxpr") or params.get("fun_jaxpr")
        consts = getattr(inner, "consts", ())
        return _run(getattr(inner, "jaxpr", inner), consts, of)
    return [np.asarray(_value(name, params, of), dtype=object)]


def _value(name: str, params: Mapping[str, Any], of: list[Any]) -> Any:
    """What a primitive makes of arrays of symbols."""
    if name in ELEMENTWISE:
        return each(ELEMENTWISE[name], *of)
    if name in UNCHANGED:
        return of[0]
    if name == "integer_pow":
        return each("power", of[0], params["y"])
    if name == "rsqrt":
        return each("reciprocal", each("sqrt", of[0]))
    if name == "logistic":
        return each("reciprocal", each("add", 1.0, each("exp", each("negative", of[0]))))
    if name == "select_n" and len(of) == 3:
        return each("where", of[0], of[2], of[1])
    if name == "clamp":
        return each("minimum", each("maximum", of[1], of[0]), of[2])
    if name == "broadcast_in_dim":
        at = [1] * len(params["shape"])
        for size, place in zip(np.shape(of[0]), params["broadcast_dimensions"], strict=True):
            at[place] = size
        return np.broadcast_to(np.reshape(of[0], at), params["shape"])
    if name == "concatenate":
        return np.concatenate(of, axis=params["dimension"])
    if name == "stack":
        return np.stack(of, axis=params.get("axis", params.get("dimension", 0)))
    if name in ("reshape", "squeeze"):
        return np.reshape(of[0], params.get("new_sizes") if name == "reshape" else np.squeeze(of[0], params["dimensions"]).shape)
    if name == "slice":
        strides = params["strides"] or [1] * len(params["start_indices"])
        return of[0][tuple(map(slice, params["start_indices"], params["limit_indices"], strides))]
    if name == "reduce_sum":
        return np.sum(of[0], axis=tuple(params["axes"]))
    raise unsupported(f"the primitive `{name}` of JAX")
