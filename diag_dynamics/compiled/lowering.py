# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What numba lowers kernels to, with three instructions in place of ten: there is as much less to write, read and optimize.

numba keeps variables and parts of arrays in memory, takes arrays apart for each call and puts them together again, looks
after each whether it has failed, and leaves it to LLVM to find out that none of it is needed. Of 150,000 instructions of a
step of the simulation, that were two in three. The numbers that come out are the same, to the bit.
"""

from llvmlite import ir as llvm
from numba.core import cgutils, ir, types
from numba.core.analysis import compute_cfg_from_blocks, compute_use_defs, must_use_alloca
from numba.core.callconv import CPUCallConv
from numba.core.cpu import CPUContext
from numba.core.lowering import Lower


class KernelLower(Lower):
    """numba's lowering of a function in which no references are counted."""

    def _find_singly_assigned_variable(self):
        """Variables that are values, in no memory: all that are assigned once, where every use comes after that.

        Of numba's own those alone are that are used in a single block.
        """
        blocks = self.func_ir.blocks
        used, before = compute_use_defs(blocks).usemap, compute_cfg_from_blocks(blocks).dominators()
        where, several = {}, set(must_use_alloca(blocks))
        for label, block in blocks.items():
            for assignment in block.find_insts(ir.Assign):
                name = assignment.target.name
                if name in where:
                    several.add(name)
                where[name] = label
        for label, names in used.items():
            # blocks are lowered by their labels
            several.update(n for n in names if n in where and not (where[n] < label and where[n] in before[label]))
        self._singly_assigned_vars, self._blk_local_varmap = where.keys() - several, {}

    def storevar(self, value, name, argidx=None):
        """Keep the value of a variable."""
        if name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
        else:
            self._alloca_var(name, self.typeof(name))
            self.builder.store(value, self.getvar(name))

    def delvar(self, name):
        """Do nothing: there is no reference to give back."""

    def lower_assign(self, ty, inst):
        """Lower an assignment."""
        if isinstance(ty, types.Dispatcher):
            return self.context.get_dummy_value()  # numba looks up where the object lies, which no call asks for
        return super().lower_assign(ty, inst)

    def lower_inst(self, inst):
        """Lower a statement."""
        if isinstance(inst, ir.SetItem | ir.StaticSetItem):
            index = inst.index if isinstance(inst, ir.SetItem) else inst.index_var
            place = self._place(inst.target, index)
            if place is not None:
                entry = self.typeof(inst.target.name).dtype
                value = self._cast_var(inst.value, entry)
                self.context.pack_value(self.builder, entry, value, place)
                return
        super().lower_inst(inst)

    def lower_expr(self, resty, expr):
        """Lower an expression."""
        if expr.op in ("getitem", "static_getitem"):
            index = expr.index if expr.op == "getitem" else expr.index_var
            if isinstance(self.typeof(expr.value.name), types.UniTuple) and expr.op == "getitem":
                return self._entry_of_tuple(expr.value, index)
            place = self._place(expr.value, index)
            if place is not None:
                entry = self.typeof(expr.value.name).dtype
                value = self.context.unpack_value(self.builder, entry, place)
                return self.context.cast(self.builder, value, entry, resty)
        if expr.op == "getattr" and isinstance(self.typeof(expr.value.name), types.Record):
            kind = self.typeof(expr.value.name).typeof(expr.attr)
            if isinstance(kind, types.NestedArray):
                return self._array_in_record(expr, kind)
        if expr.op in ("getiter", "iternext"):
            given = self.typeof(expr.value.name)
            if isinstance(given, types.RangeType) and _is_signed(given.dtype):
                return self._start_of_range(resty, self.loadvar(expr.value.name))
            if isinstance(given, types.RangeIteratorType) and _is_signed(given.yield_type):
                return self._next_of_range(resty, self.loadvar(expr.value.name))
        return super().lower_expr(resty, expr)

    def _array_in_record(self, expr, kind):
        """A field of a record that is an array."""
        record, context = self.typeof(expr.value.name), self.context
        data = cgutils.get_record_member(
            self.builder,
            self.loadvar(expr.value.name),
            record.offset(expr.attr),
            context.get_data_type(kind.dtype),
        )
        shape, strides = ([context.get_constant(types.intp, n) for n in of] for of in (kind.shape, kind.strides))
        return packed_array(context, self.builder, kind, data, shape, strides)

    def _entry_of_tuple(self, given, index):
        """Entry of a tuple at an index that is no constant."""
        builder, value = self.builder, self.loadvar(given.name)
        kind, k = self.typeof(given.name), self._cast_var(index, types.intp)
        result = builder.extract_value(value, 0)
        for one in range(1, len(kind)):
            same = [builder.icmp_signed("==", k, k.type(j)) for j in (one, one - len(kind))]
            result = builder.select(builder.or_(*same), builder.extract_value(value, one), result)
        return result

    def lower_call(self, resty, expr):
        """Lower a call."""
        function, given = self.typeof(expr.func.name), [self.typeof(arg.name) for arg in expr.args]
        if isinstance(function, types.Function) and not expr.kws and not expr.vararg:
            if function.typing_key is range and _is_signed(resty.dtype):
                return self._range(resty, [self._cast_var(arg, resty.dtype) for arg in expr.args])
            if (
                function.typing_key in (min, max)
                and len(given) > 1
                and (isinstance(resty, types.Float) or _is_signed(resty))
            ):
                return self._extreme(resty, function.typing_key, [self._cast_var(arg, resty) for arg in expr.args])
            if function.typing_key is len and isinstance(given[0], types.Array):
                [array] = expr.args
                position = self.context.data_model_manager[given[0]].get_field_position("shape")
                return self.builder.extract_value(self.loadvar(array.name), [position, 0])
        return super().lower_call(resty, expr)

    def _range(self, kind, given):
        """A range as its start, end and step."""
        whole = given[0].type
        return self._packed(kind, [whole(0), *given, whole(1)] if len(given) == 1 else [*given, whole(1)][:3])

    def _start_of_range(self, kind, given):
        """The address of the next number, the end, the step."""
        builder = self.builder
        start, end, step = (builder.extract_value(given, k) for k in range(3))
        with builder.goto_entry_block():
            place = builder.alloca(start.type)
        builder.store(start, place)
        return self._packed(kind, [place, end, step, llvm.Constant(place.type, None)])

    def _next_of_range(self, kind, given):
        """The next number, and whether it is one of the range; of one whose step is 0 none is."""
        builder = self.builder
        place, end, step = (builder.extract_value(given, k) for k in range(3))
        number = builder.load(place)
        upward, downward = (builder.icmp_signed(sign, step, step.type(0)) for sign in "><")
        inside = builder.select(
            upward,
            builder.icmp_signed("<", number, end),
            builder.and_(downward, builder.icmp_signed(">", number, end)),
        )
        builder.store(builder.add(number, step, flags=["nsw"]), place)
        return self._packed(kind, [number, inside])

    def _extreme(self, kind, which, given):
        """The least or the largest of some numbers: of those that are equal, or no numbers, the first, as in Python."""
        builder, result = self.builder, given[0]
        compare = builder.fcmp_ordered if isinstance(kind, types.Float) else builder.icmp_signed
        for other in given[1:]:
            result = builder.select(compare("<" if which is min else ">", other, result), other, result)
        return result

    def _packed(self, kind, values):
        packed = llvm.Constant(self.context.get_value_type(kind), llvm.Undefined)
        for k, value in enumerate(values):
            packed = self.builder.insert_value(packed, value, k)
        return packed

    def _place(self, array, index):
        """Address of one entry of a contiguous array; None if it is something else that is asked for."""
        kind = self.typeof(array.name)
        if not isinstance(kind, types.Array) or kind.layout != "C" or not kind.aligned or index is None:
            return None
        of = self.typeof(index.name)
        kinds = tuple(of) if isinstance(of, types.BaseTuple) else (of,)
        if len(kinds) != kind.ndim or not all(map(_is_signed, kinds)):
            return None
        builder, value, given = self.builder, self.loadvar(array.name), self.loadvar(index.name)
        fields = self.context.data_model_manager[kind]
        shape, offset = builder.extract_value(value, fields.get_field_position("shape")), None
        for axis, one in enumerate(kinds):
            k = builder.extract_value(given, axis) if isinstance(of, types.BaseTuple) else given
            k = self.context.cast(builder, k, one, types.intp)
            extent = builder.extract_value(shape, axis)
            if not (isinstance(k, llvm.Constant) and k.constant >= 0):
                negative = builder.icmp_signed("<", k, llvm.Constant(k.type, 0))
                k = builder.select(negative, builder.add(k, extent), k)
            offset = k if offset is None else builder.add(builder.mul(offset, extent), k)
        return builder.gep(builder.extract_value(value, fields.get_field_position("data")), [offset])


class MayFailError(Exception):
    """A kernel has to say whether it has failed."""


class _NoStatus(CPUCallConv):
    """What numba does where an exception is raised, or a function that was called has failed."""

    def return_user_exc(self, *args, **kws):
        raise MayFailError

    return_status_propagate = return_user_exc


class _WithoutStatus(CPUContext):
    """Where numba asks how functions are called."""

    @property
    def call_conv(self):
        return _NoStatus(self)


class PartLower(KernelLower):
    """Of a kernel that cannot fail: it takes and returns values, where numba's functions return a status.

    Raises
    ------
    MayFailError
        Something in it may raise an exception, or numba does not know better: lower it as :class:`KernelLower` does.
    """

    def __init__(self, *args, **kws):
        super().__init__(*args, **kws)
        self.context.__class__ = _WithoutStatus  # it is a copy, of this function alone

    def setup_function(self, fndesc):
        """Begin a function."""
        self.function = _declared(self.context, self.module, fndesc)
        self.entry_block = self.function.append_basic_block("entry")
        self.builder = llvm.IRBuilder(self.entry_block)

    def extract_function_arguments(self):
        """Take the arguments as they are."""
        given = iter(self.function.args)
        self.fnargs, self.call_helper = [next(given) if _is_passed(k) else None for k in self.fndesc.argtypes], None
        return self.fnargs

    def lower_inst(self, inst):
        """Lower a statement."""
        if isinstance(inst, ir.Return):
            self.builder.ret(self._cast_var(inst.value, self.fndesc.restype))
        else:
            super().lower_inst(inst)


def _is_signed(kind):
    """Whether a type is that of whole numbers with a sign, as indices are."""
    return isinstance(kind, types.Integer) and kind.signed


def _is_passed(kind):
    """Whether an argument of a type is given: a default is known."""
    return not isinstance(kind, types.Omitted)


def _declared(context, module, description):
    """The function of a kernel in a module."""
    given = [context.get_value_type(kind) for kind in description.argtypes if _is_passed(kind)]
    kind = llvm.FunctionType(context.get_value_type(description.restype), given)
    function = cgutils.get_or_insert_function(module, kind, description.mangled_name)
    if description.inline:
        function.attributes.add("alwaysinline")
    return function


def called(description, libraries):
    """What lowers a call of a kernel that cannot fail, in functions of others, too."""

    def call(context, builder, signature, args):
        given = [arg for arg, kind in zip(args, description.argtypes, strict=True) if _is_passed(kind)]
        return builder.call(_declared(context, builder.module, description), given)

    call.signature, call.libs = description.argtypes, libraries
    return call


def packed_array(context, builder, kind, data, shape, strides):
    """An array, of its parts; all numbers are values of LLVM's."""
    model = context.data_model_manager[kind]
    count = shape[0]
    for extent in shape[1:]:
        count = builder.mul(count, extent)
    size = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    result = llvm.Constant(model.get_value_type(), llvm.Undefined)
    for name, value in (
        ("meminfo", None),
        ("parent", None),
        ("nitems", count),
        ("itemsize", count.type(size)),
        ("data", data),
        ("shape", _pack(builder, shape)),
        ("strides", _pack(builder, strides)),
    ):
        position = model.get_field_position(name)
        if value is None:
            value = llvm.Constant(result.type.elements[position], None)
        result = builder.insert_value(result, value, position)
    return result


def _pack(builder, numbers):
    packed = llvm.Constant(llvm.ArrayType(numbers[0].type, len(numbers)), llvm.Undefined)
    for k, number in enumerate(numbers):
        packed = builder.insert_value(packed, number, k)
    return packed
