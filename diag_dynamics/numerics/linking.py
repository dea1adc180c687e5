# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compile kernels in a third of the time: each is only lowered, and an entry links and optimizes all that it calls, once.

numba optimizes and emits machine code for every function with all functions below it, although nobody calls kernels from
Python. This module uses numba's code libraries, which are private. Without it, entries have the same code: see kernel.
"""

from llvmlite.binding import Linkage
from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.typed_passes import AnnotateTypes, NativeLowering


class Library(JITCodeLibrary):
    """A library that neither optimizes what it is given nor the libraries that it calls."""

    def add_linking_library(self, library):
        """Store a library that this one calls."""
        self._linking_libraries.append(library)

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
            finished = library._get_module_for_linking() if library._finalized else _shareable(library._final_module)
            module.link_in(finished, preserve=True)


def _shareable(module):
    """Return a copy of a module whose functions may be in another one, too."""
    module = module.clone()
    for function in module.functions:
        if not function.is_declaration and function.linkage == Linkage.external:
            function.linkage = "linkonce_odr"
    return module


class KernelLibrary(Library):
    """Library of a kernel: what numba lowered it to."""

    def _ensure_finalized(self):
        """Do nothing: an entry, or a function of numba's, links it as it is."""

    def _get_module_for_linking(self):
        if self._shared_module is None:
            module = self._final_module.clone()
            self._link(module)
            self._shared_module = _shareable(module)
        return self._shared_module


class EntryLibrary(Library):
    """Library of an entry: links, optimizes and emits."""

    def finalize(self):
        """Link everything below; optimize and emit once."""
        self._link(self._final_module)
        self._linking_libraries = []
        super().finalize()


class _Pass(LoweringPass):
    def __init__(self):
        super().__init__()


class _ChooseLibrary(_Pass):
    library = EntryLibrary

    def run_pass(self, state):
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class _ChooseEntryLibrary(_ChooseLibrary):
    _name = "choose_entry_library"


@register_pass(mutates_CFG=False, analysis_only=False)
class _ChooseKernelLibrary(_ChooseLibrary):
    _name, library = "choose_kernel_library", KernelLibrary

    def run_pass(self, state):
        state.flags.no_compile = True  # numba would ask for the address of the function
        return super().run_pass(state)


@register_pass(mutates_CFG=False, analysis_only=False)
class _DeclareKernel(_Pass):
    """Let other functions call a kernel that has no machine code."""

    _name = "declare_kernel"

    def run_pass(self, state):
        description, library = state.cr.fndesc, (state.library,)
        name = description.qualname.split(".")[-1]
        function = _dynfunc.make_function(description.lookup_module(), name, "", 0, state.cr.env, library)
        state.targetctx.insert_user_function(function, description, library)
        state.cr = state.cr._replace(cfunc=function)
        return True


class EntryCompiler(CompilerBase):
    """numba's compiler, into an :class:`EntryLibrary`."""

    def define_pipelines(self):
        """Return numba's passes with those above."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_ChooseEntryLibrary, AnnotateTypes)
        passes.finalize()
        return [passes]


class KernelCompiler(CompilerBase):
    """numba's compiler, into a :class:`KernelLibrary`."""

    def define_pipelines(self):
        """Return numba's passes with those above."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_ChooseKernelLibrary, AnnotateTypes)
        passes.add_pass_after(_DeclareKernel, NativeLowering)
        passes.finalize()
        return [passes]
