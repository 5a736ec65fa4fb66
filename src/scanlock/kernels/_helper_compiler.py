"""Compilation of helpers, the functions that only kernels call.

Numba optimises each function, emits its machine code and wraps it for calls from Python, then
links the optimised code into the callers and optimises it again there. Helpers need the last step
alone. They are linked unoptimised and have no machine code, so a call from Python ends the
process.
"""

from importlib import import_module
from typing import Any

from numba.core import codegen, compiler, compiler_machinery, typed_passes

# Numba has no stubs for its passes and code libraries.
_codegen: Any = codegen
_compiler: Any = compiler
_machinery: Any = compiler_machinery
_passes: Any = typed_passes
_functions: Any = import_module("numba._dynfunc")


class _HelperLibrary(_codegen.JITCodeLibrary):
    """Code of a helper, which its callers optimise."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        # The base class also emits machine code here.
        self._finalize_dynamic_globals()
        self._finalized = True


@_machinery.register_pass(mutates_CFG=True, analysis_only=False)
class _HelperLowering(_passes.NativeLowering):
    """Translation of a helper to the compiler's language."""

    _name = "scanlock_helper_lowering"

    def run_pass(self, state: Any) -> bool:
        name = state.func_id.func_qualname
        library = state.library = _HelperLibrary(state.targetctx.codegen(), name)
        state.flags.no_compile = True
        super().run_pass(state)
        helper = state.cr
        module = helper.fndesc.lookup_module()
        # Callers find the code by this object, whose address of machine code is null.
        entry = _functions.make_function(module, name, "", 0, helper.env, (library,))
        state.targetctx.insert_user_function(entry, helper.fndesc, [library])
        state.cr = helper._replace(cfunc=entry)
        return True


class HelperCompiler(_compiler.CompilerBase):
    """Numba's compiler with the lowering of helpers."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        manager = _compiler.DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.passes = [
            (_HelperLowering if one is _passes.NativeLowering else one, description)
            for one, description in manager.passes
        ]
        manager.finalize()
        return [manager]
