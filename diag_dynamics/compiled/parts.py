# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How kernels become machine code: parts are only lowered; an entry links all parts below it, and is optimized once.

numba's own way is to link, optimize and emit every function for itself, with all functions below it: of a step of the
simulation, seven of eight instructions were emitted for nobody to call. What is here rests on numba's code libraries, which
are private: :mod:`~diag_dynamics.compiled.plain` does without.
"""

import functools
import weakref

from llvmlite.binding import Linkage, parse_assembly
from numba import _dynfunc
from numba.core import cgutils, types, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.imputils import user_function
from numba.core.typed_passes import (
    NativeLowering,
    NoPythonBackend,
    NopythonTypeInference,
    PreLowerStripPhis,
)

from diag_dynamics.compiled.lowering import KernelLower, MayFailError, PartLower, called

OPTIMIZED = 3
"""Level of LLVM's passes over an entry. At 3 they take 3 of 36 CPU-seconds longer, and what they make is no faster."""


class _Library(JITCodeLibrary):
    """A library that leaves what it calls as it is, until an entry links it."""

    def add_ir_module(self, module):
        """Take what was lowered as it is: numba would optimize each function here, and the entry does that once more."""
        self._final_module.link_in(parse_assembly(cgutils.normalize_ir_text(str(module))))

    def add_linking_library(self, library):
        self._linking_libraries.append(library)  # numba would have it optimized and emitted here

    def _below(self):
        """All libraries that this one needs, callers before those that they call.

        LLVM's linker drops a function that nobody refers to yet.
        """
        order, seen = [], {self}

        def visit(library):
            for other in library._linking_libraries if _is_raw(library) else ():
                if other not in seen:
                    seen.add(other)
                    visit(other)
            order.append(library)

        visit(self)
        return order[-2::-1]

    def _link(self, module):
        """Link everything below into a module that has this library's functions."""
        for library in self._below():
            self._reload_init.update(library._reload_init)
            module.link_in(_shared(library) if _is_raw(library) else library._get_module_for_linking(), preserve=True)
        for function in module.functions:
            if function.is_declaration and function.name.startswith("_ZN"):  # LLVM would end the process
                raise RuntimeError(f"{self.name} calls {function.name}, which is in no library")


def _is_raw(library):
    """Whether a library is as it was lowered; one of numba's own may be, too."""
    return isinstance(library, Part) or not library._finalized


_modules = weakref.WeakKeyDictionary()


def _shared(library):
    """The module of a raw library, its functions such that there may be one of the same name already."""
    module = _modules.get(library)
    if module is None:
        module = _modules[library] = _lent_out(library._final_module.clone())
    return module


def _lent_out(module):
    for function in module.functions:
        if not function.is_declaration and function.linkage == Linkage.external:
            function.linkage = "linkonce_odr"
    return module


class Part(_Library):
    """Library of a kernel: what it was lowered to."""

    def _ensure_finalized(self):
        """Be ready for linking, which a part always is."""

    def get_pointer_to_function(self, name):
        """None: Python cannot call it."""
        return 0

    def _get_module_for_linking(self):
        """For numba's own libraries, which call a kernel: the part and everything below it."""
        if self._shared_module is None:
            module = self._final_module.clone()
            self._link(module)
            self._shared_module = _lent_out(module)
        return self._shared_module


class Entry(_Library):
    """Library of what Python calls."""

    def finalize(self):
        """Link, optimize and emit."""
        self._link(self._final_module)
        self._linking_libraries = []
        super().finalize()

    def _optimize_final_module(self):
        # Kernels are inlined first: inlined by the passes that follow, they take five times as long.
        for options in (
            {"opt": 0, "cost": "cheap", "loop_vectorize": False},
            {"opt": OPTIMIZED, "loop_vectorize": True},
        ):
            passes, builder = self._codegen._module_pass_manager(slp_vectorize=False, **options)
            passes.run(self._final_module, builder)


class _Lowering(NativeLowering):
    """numba's pass that lowers, into a library of a given kind."""

    _library = Entry
    lowering_class = KernelLower

    def run_pass(self, state):
        state.library = self._library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().run_pass(state)


@register_pass(mutates_CFG=True, analysis_only=False)
class _LoweringOfPart(_Lowering):
    _name, _library = "lowering_of_part", Part

    def run_pass(self, state):
        state.flags.no_compile = True  # numba would ask the machine code for its address
        self.lowering_class, caller = PartLower, called
        try:
            super().run_pass(state)
        except MayFailError:
            self.lowering_class, caller = KernelLower, user_function
            super().run_pass(state)
        lowered, library = state.cr, state.library
        description = lowered.fndesc
        # What stands for it where it is called; that nothing can call.
        name = description.qualname.split(".")[-1]
        handle = _dynfunc.make_function(description.lookup_module(), name, "", 0, lowered.env, (library,))
        call = caller(description, (library,))
        state.targetctx._defns[handle].append(call, call.signature)
        state.cr = lowered._replace(cfunc=handle)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _LoweringOfEntry(_Lowering):
    _name = "lowering_of_entry"


@register_pass(mutates_CFG=True, analysis_only=False)
class _Inference(NopythonTypeInference):
    """numba's, which without counted references forbids to return an array; a kernel's are kept alive by its caller."""

    _name = "inference_of_kernel"

    def run_pass(self, state):
        context = state.typingctx
        counted, state.targetctx.enable_nrt = state.targetctx.enable_nrt, True
        resolve = context._resolve_user_function_type
        context._resolve_user_function_type = functools.partial(_resolved, context)
        try:
            return super().run_pass(state)
        finally:
            state.targetctx.enable_nrt, context._resolve_user_function_type = counted, resolve


_signatures = {}


def _resolved(context, function, args, kws, literals=None):
    """What numba finds for an operator or a function of its own: sought once, as there are fifty candidates for a sum."""
    key = (function, tuple(args)) if not kws and not isinstance(function, types.Dispatcher) else None
    found = _signatures.get(key)
    if found is None:
        found = type(context)._resolve_user_function_type(context, function, args, kws, literals)
        if key:
            _signatures[key] = found
    return found


_FRONT = (
    untyped_passes.TranslateByteCode,
    untyped_passes.FixupArgs,
    untyped_passes.IRProcessing,
    untyped_passes.RewriteSemanticConstants,
    untyped_passes.DeadBranchPrune,
    untyped_passes.GenericRewrites,  # constant indices of tuples
    untyped_passes.ReconstructSSA,
    untyped_passes.DeadBranchPrune,
    _Inference,
    PreLowerStripPhis,
)
"""numba's passes that kernels need. Without the others (closures, `with`, literal loops, array expressions, the ends of
variables' lives, annotations for people) compiling takes 5 % less time."""


class _Passes(PassManager):
    """numba's, without a look after each pass at what lives where, which nothing here asks for."""

    _ENFORCING = False


class _Compiler(CompilerBase):
    _lowering = None

    def define_pipelines(self):
        passes = _Passes("kernel")
        for one in (*_FRONT, self._lowering, NoPythonBackend):
            passes.add_pass(one, one.__name__)
        passes.finalize()
        return [passes]


class PartCompiler(_Compiler):
    """numba's compiler for kernels."""

    _lowering = _LoweringOfPart


class EntryCompiler(_Compiler):
    """numba's compiler for what Python calls."""

    _lowering = _LoweringOfEntry
