# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compile kernels in a quarter of the time: each is simplified once, and an entry links all that it calls and emits it.

numba optimizes and emits machine code for every function with all functions below it. Python calls entries alone, so this
work is lost for kernels. This module uses numba's code libraries, which are private. Where they fail, numba's own linking
gives the same bits: see works.
"""

import logging
import math

import numba
from llvmlite import binding
from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.registry import cpu_target
from numba.core.typed_passes import AnnotateTypes, NativeLowering

logger = logging.getLogger(__name__)


class Library(JITCodeLibrary):
    """Library of an entry, which links, optimizes and emits, or of a kernel: what numba lowered it to."""

    is_entry, is_inlined, simplified = True, False, None

    def add_llvm_module(self, module):
        """Store code without numba's passes over each function, which simplify little before kernels are inlined."""
        module.data_layout = self._codegen._data_layout
        self._final_module.link_in(module)

    def add_linking_library(self, library):
        """Store a library that this one calls."""
        self._linking_libraries.append(library)

    def finalize(self):
        """Emit code of an entry alone: an entry, or a function of numba's, links a kernel as it is."""
        if self.is_entry:
            self._link(self._final_module)
            self._linking_libraries = []
            super().finalize()

    def _get_module_for_linking(self):
        if self._shared_module is None and not self.is_entry:
            module = self._simplify().clone()
            self._link(module)
            self._shared_module = _shareable(module)
        return super()._get_module_for_linking()

    def _link(self, module):
        """Link all libraries below into `module`, callers first, because LLVM drops functions without a reference."""
        order, visited = [], {self}

        def visit(library):
            for other in () if library._finalized else library._linking_libraries:
                if other not in visited:
                    visited.add(other)
                    visit(other)
            order.append(library)

        visit(self)
        for library in order[-2::-1]:
            if hasattr(self, "_reload_init"):  # numba 0.58 has none
                self._reload_init.update(library._reload_init)
            module.link_in(_linkable(library), preserve=True)

    def _simplify(self):
        """Return the code; an inlined kernel's with the kernels that it calls, simplified once for all callers."""
        if self.simplified is None:
            if self.is_inlined and hasattr(self._codegen, "_pass_builder"):  # LLVM 14 simplifies before it inlines
                for library in self._linking_libraries:
                    if getattr(library, "is_inlined", False):
                        self._final_module.link_in(library._simplify(), preserve=True)
                inliner = binding.create_new_module_pass_manager()
                inliner.add_always_inliner_pass()
                inliner.run(self._final_module, self._codegen._pass_builder(opt=1))
                for function in self._final_module.functions:
                    if not function.is_declaration:
                        passes, builder = self._codegen._function_pass_manager(opt=1)
                        passes.run(function, builder)
            self.simplified = _shareable(self._final_module)
        return self.simplified


def _linkable(library):
    """Return the code of one library, to be linked into others."""
    if library._finalized:
        return library._get_module_for_linking()
    return library._simplify() if isinstance(library, Library) else _shareable(library._final_module)


def _shareable(module):
    """Return a copy of a module whose functions may be in another one, too."""
    module = module.clone()
    for function in module.functions:
        if not function.is_declaration and function.linkage == binding.Linkage.external:
            function.linkage = "linkonce_odr"
    return module


@register_pass(mutates_CFG=False, analysis_only=False)
class _ChooseLibrary(LoweringPass):
    _name = "choose_library"

    def __init__(self):
        super().__init__()

    def run_pass(self, state):
        state.library = Library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        state.library.is_entry, state.library.is_inlined = not state.flags.no_cpython_wrapper, state.flags.forceinline
        state.flags.no_compile = state.flags.no_cpython_wrapper  # else numba asks for the address of a kernel
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class _DeclareKernel(LoweringPass):
    """Let other functions call a kernel that has no machine code."""

    _name = "declare_kernel"

    def __init__(self):
        super().__init__()

    def run_pass(self, state):
        if not state.library.is_entry:
            description, library = state.cr.fndesc, (state.library,)
            name = description.qualname.split(".")[-1]
            function = _dynfunc.make_function(description.lookup_module(), name, "", 0, state.cr.env, library)
            state.targetctx.insert_user_function(function, description, library)
            state.cr = state.cr._replace(cfunc=function)
        return True


class KernelCompiler(Compiler):
    """numba's compiler into a :class:`Library`, if that works."""

    works = None

    def define_pipelines(self):
        """Return numba's passes with those above."""
        if not works():
            return super().define_pipelines()
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_ChooseLibrary, AnnotateTypes)
        passes.add_pass_after(_DeclareKernel, NativeLowering)
        passes.finalize()
        return [passes]


def works():
    """Whether a kernel, one that calls it, and an entry give the right number; tried once."""
    if KernelCompiler.works is None:
        KernelCompiler.works, error = True, "a wrong result"  # for the kernels tried
        try:
            KernelCompiler.works = _compile_pair()(4.0) == 5.0
        except Exception as raised:
            KernelCompiler.works, error = False, repr(raised)
        if not KernelCompiler.works:
            logger.warning("Kernels compile slowly under numba %s: %s", numba.__version__, error)
    return KernelCompiler.works


def _compile_pair():
    kernel = {"no_cpython_wrapper": True, "pipeline_class": KernelCompiler}

    @numba.njit(forceinline=True, **kernel)
    def root(x):
        if x < 0.0:
            raise ValueError("negative")
        return math.sqrt(x), x > 1.0

    @numba.njit(**kernel)
    def both(x):
        return root(x)[0] + (1.0 if root(1.0 + x)[1] else 0.0)

    return numba.njit(pipeline_class=KernelCompiler)(lambda x: both(x) + both(x - x + 1.0))


def supported(*names):
    """Return the options among `names` that this numba has; they are not documented."""
    return {name: True for name in names if hasattr(cpu_target.options, name)}


def hook_entry(entry, called, compile_entry):
    """Have the first call from Python compile an entry by a function, and kernels call another one in its place."""
    entry._compile_for_args = compile_entry
    entry.get_call_template, entry.get_overload = called.get_call_template, called.get_overload
