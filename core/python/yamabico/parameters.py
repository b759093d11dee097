"""Parameters: the keys of a plugin's own table in a task or robot file, checked before the plugin starts.

The suffix of a key is its unit (`gap_m`, `speed_mps`, `period_ms`, `fov_deg`).
"""


class Parameter:
    """A parameter, required unless it has a default. Read from an instance, it is the value in the file or the default."""

    def __init__(self, summary, schema, default=None):
        self.summary, self.default = summary, default
        self._schema = schema

    def __set_name__(self, owner, name):
        self.name = name

    def __get__(self, instance, owner=None):
        return self if instance is None else instance.parameters.get(self.name, self.default)

    def schema(self):
        """Returns the JSON Schema of the parameter."""
        schema = {**self._schema, "description": self.summary}
        return schema if self.default is None else {**schema, "default": self.default}


class Number(Parameter):
    """A number from `minimum` to `maximum`."""

    def __init__(self, summary, minimum, maximum, default=None):
        super().__init__(summary, {"type": "number", "minimum": minimum, "maximum": maximum}, default)


class Integer(Parameter):
    """An integer from `minimum` to `maximum`."""

    def __init__(self, summary, minimum, maximum, default=None):
        super().__init__(summary, {"type": "integer", "minimum": minimum, "maximum": maximum}, default)


class Numbers(Parameter):
    """A list of numbers, each from `minimum` to `maximum`."""

    def __init__(self, summary, minimum, maximum, default=None):
        item = {"type": "number", "minimum": minimum, "maximum": maximum}
        super().__init__(summary, {"type": "array", "items": item}, default)


class Switch(Parameter):
    """A boolean."""

    def __init__(self, summary, default=None):
        super().__init__(summary, {"type": "boolean"}, default)


class Word(Parameter):
    """A string; one of `choices` if any are given."""

    def __init__(self, summary, choices=(), default=None):
        super().__init__(summary, {"type": "string", **({"enum": list(choices)} if choices else {})}, default)


class Group(Parameter):
    """A nested table: an instance of a class whose attributes are parameters."""

    def __init__(self, summary, inside):
        super().__init__(summary, schema_of(inside))
        self.inside = inside
        if "required" not in self._schema:
            self.default = {}

    def __get__(self, instance, owner=None):
        if instance is None:
            return self
        group = self.inside()
        group.parameters = instance.parameters.get(self.name, {})
        return group


def parameters_of(owner):
    """Returns the parameters of a class, inherited ones first."""
    found = {}
    for base in reversed(owner.__mro__):
        found.update((name, value) for name, value in vars(base).items() if isinstance(value, Parameter))
    return found


def schema_of(owner):
    """Returns the JSON Schema of a class's parameters."""
    parameters = parameters_of(owner)
    required = [name for name, parameter in parameters.items() if parameter.default is None]
    schema = {
        "type": "object",
        "additionalProperties": False,
        "properties": {name: parameter.schema() for name, parameter in parameters.items()},
    }
    return {**schema, "required": required} if required else schema
