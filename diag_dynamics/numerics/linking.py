# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compile kernels in half the time. Everything here is private to numba, and may be missing.

numba optimizes each function together with all functions that it calls, and emits machine code for
it. Python calls entries alone: the code of a kernel is inlined into its callers' code, simplified,
and not emitted. Of a table, kernels compile the fields alone that they use.
"""

import logging
import math
from functools import cache, partial
from pathlib import Path

import numba
from llvmlite import binding
from numba import _dynfunc, types
from numba.core.caching import CacheImpl
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import cpu_target
from numba.core.runtime import nrtdynmod
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, register_model

from diag_dynamics.numerics.cache import PACKAGE, cache_folder
from diag_dynamics.numerics.progress import begin_compilation

logger = logging.getLogger(__name__)


class Library(JITCodeLibrary):
    """Code of an entry or of a kernel, and of all kernels that it calls."""

    is_entry = True

    def _optimize_functions(self, module):
        """Omit numba's passes over functions: before kernels are inlined they simplify little."""
        module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self):
        """Optimize an entry; inline kernels into a kernel and simplify it once for all callers."""
        if self.is_entry:
            super()._optimize_final_module()
        elif hasattr(
            self._codegen, "_pass_builder"
        ):  # LLVM 14 has it not, and simplifies in the entry
            inliner = binding.create_new_module_pass_manager()
            inliner.add_always_inliner_pass()
            inliner.run(self._final_module, self._codegen._pass_builder(opt=1))
            for function in self._final_module.functions:
                if (
                    function.linkage == binding.Linkage.external and not function.is_declaration
                ):  # not of other kernels
                    passes, builder = self._codegen._function_pass_manager(opt=1)
                    passes.run(function, builder)

    def _finalize_final_module(self):
        """Emit machine code of an entry."""
        if self.is_entry:
            super()._finalize_final_module()
        self._finalized = True

    def serialize_using_object_code(self):
        """Return machine code of an entry, and empty functions of the same names.

        numba keeps bitcode for functions that call it; those compile the kernel instead.
        """
        functions = self.get_defined_functions()
        empty = "".join(f'define void @"{x.name}"() {{ ret void }}' for x in functions)
        code = self._get_compiled_object(), binding.parse_assembly(empty).as_bitcode()
        return self.name, "object", code


class RuntimeLibrary:
    """numba's functions for the memory of arrays, compiled for a function that calls them.

    numba would compile them also to load compiled code, which contains them.
    """

    def __init__(self, context, build=nrtdynmod.compile_nrt_functions):
        self._build = cache(partial(build, context))

    def __getattr__(self, name):
        """Return an attribute of the compiled library."""
        return getattr(self._build(), name)


nrtdynmod.compile_nrt_functions = RuntimeLibrary


class CodeLocator(CacheImpl._locator_classes[0]):
    """Place of compiled code in a folder of ours, the same for all copies of the package.

    The name of the folder has the hash of the sources, but not of all that other packages import.
    """

    @classmethod
    def from_function(cls, function, file):
        """Return the place, None in a folder of others and for functions of other packages."""
        is_ours = f"{function.__module__}.".startswith(f"{PACKAGE.name}.")
        if is_ours and Path(numba.config.CACHE_DIR).parent == cache_folder():
            return super().from_function(function, file)
        return None

    @classmethod
    def get_suitable_cache_subpath(cls, file):
        """Return the name of the module's folder, without its path."""
        return Path(file).parent.name

    def get_source_stamp(self):
        """Return no time: those of copies differ."""


CacheImpl._locator_classes.insert(0, CodeLocator)


class KernelCompiler(Compiler):
    """numba's compiler into a :class:`Library`, if that works."""

    works = None

    def define_pipelines(self):
        """Return numba's passes."""
        state = self.state
        begin_compilation()
        if works():
            state.library = Library(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()
            state.library.is_entry = not state.flags.no_cpython_wrapper
            # Without it numba asks for the address of a kernel.
            state.flags.no_compile = state.flags.no_cpython_wrapper
        return super().define_pipelines()

    def compile_extra(self, function):
        """Compile a function; declare a kernel, which has no address, to other functions."""
        result = super().compile_extra(function)
        if result.entry_point is None:
            about = result.fndesc
            libraries = (result.library,)
            name = about.qualname.split(".")[-1]
            declared = _dynfunc.make_function(
                about.lookup_module(), name, "", 0, result.environment, libraries
            )
            self.state.targetctx.insert_user_function(declared, about, libraries)
            return result._replace(entry_point=declared)
        return result


def works():
    """Whether a kernel, one that calls it, and an entry give the right number; tried once."""
    if KernelCompiler.works is None:
        KernelCompiler.works = True  # for the kernels tried
        error = "a wrong result"
        try:
            KernelCompiler.works = _compile_pair()(4.0) == 5.0
        except Exception as raised:
            KernelCompiler.works = False
            error = repr(raised)
        if not KernelCompiler.works:
            logger.warning("Kernels compile slowly under numba %s: %s", numba.__version__, error)
    return KernelCompiler.works


def _compile_pair():
    @numba.njit(**KERNEL)
    def root(x):
        return math.sqrt(x), x > 1.0

    @numba.njit(**LARGE_KERNEL)
    def both(x):
        return root(x)[0] + (1.0 if root(1.0 + x)[1] else 0.0)

    return numba.njit(**ENTRY)(lambda x: both(x) + both(x - x + 1.0))


def _supported(**options):
    """Return the options that this numba has."""
    return {name: value for name, value in options.items() if hasattr(cpu_target.options, name)}


# Without reference counts: no kernel allocates, and LLVM does not vectorize a loop that counts.
ENTRY = {"pipeline_class": KernelCompiler} | _supported(_nrt=False, no_cfunc_wrapper=True)
LARGE_KERNEL = ENTRY | _supported(no_cpython_wrapper=True)
KERNEL = LARGE_KERNEL | _supported(forceinline=True)
ARRAY_KERNEL = KERNEL | _supported(_nrt=True)


# --- Tables


class Reference(types.Opaque):
    """A table as kernels see it: its address. A field is read where a kernel uses it."""

    def __init__(self, name, fields):
        super().__init__(f"Table({name})")
        self.fields = fields


register_model(Reference)(models.OpaqueModel)


@infer_getattr
class Fields(AttributeTemplate):
    """Types of the fields of a table."""

    key = Reference

    def generic_resolve(self, table, name):
        """Return the type of a field, or None."""
        return table.fields.get(name, (None,))[0]


@lower_getattr_generic(Reference)
def _read_field(context, builder, table, address, name):
    """Read a field. No kernel writes it: LLVM may read it once for a loop."""
    kind, offset = table.fields[name]
    is_array = isinstance(kind, types.Array)
    pointer = context.get_value_type(types.CPointer(types.intp if is_array else kind))
    entry = builder.gep(address, [context.get_constant(types.intp, offset)])
    first = builder.bitcast(entry, pointer)
    values = []
    for k in range(1 + kind.ndim if is_array else 1):
        value = builder.load(builder.gep(first, [context.get_constant(types.intp, k)]))
        value.set_metadata("invariant.load", builder.module.add_metadata([]))
        values.append(value)
    if not is_array:
        return values[0]
    size = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    strides = [context.get_constant(types.intp, size)]
    for length in reversed(values[2:]):
        strides.insert(0, builder.mul(strides[0], length))
    array = context.make_array(kind)(context, builder)
    data = builder.inttoptr(values[0], array.data.type)
    context.populate_array(
        array, data=data, shape=values[1:], strides=strides, itemsize=size, meminfo=None
    )
    return array._getvalue()


def table_at(name, fields):
    """Kernel (address) that returns a table; `fields` has the type and the offset of each."""
    table = Reference(name, fields)

    @intrinsic
    def opened(typingctx, address):
        def lower(context, builder, signature, args):
            return builder.inttoptr(args[0], context.get_value_type(table))

        return table(types.intp), lower

    return opened
