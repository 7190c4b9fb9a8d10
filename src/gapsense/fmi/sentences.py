"""Every sentence that a component says to its user, once, for the Python FMU and for the native one.

The texts are formats that Python's `%` and C's printf read alike: %s, %d, %u, %g, %.3g and %.9g, nothing else.  What a
%s stands for is made by whoever says the sentence; a number among them is written as Python's `repr` does.  Standard
library only, because a copy travels in every FMU; the native build makes a C header of the table.
"""

from __future__ import annotations

from typing import Any

SENTENCES = {
    # Where: instance, component, and what follows; with time and step in a step.
    "said": "`%s` (%s): %s",
    "said_in_step": "`%s` (%s), t = %.9g s, step = %.9g s: %s",
    # Instantiation.
    "model_exchange": "this FMU is for co-simulation, not for model exchange. Choose co-simulation in the tool.",
    "wrong_guid": "the tool gave the GUID `%s`, but this FMU has `%s`. Unpack the FMU and read its description again.",
    # Order of calls: call, phase, phases in which it is allowed.
    "wrong_phase": "%s is not allowed in phase `%s`, only in %s."
    " Set up, initialise, step and terminate in this order, or reset the instance.",
    "not_provided": "%s is not provided. Call only what the model description says.",
    # Variables.
    "no_variable": "there is no %s variable with value reference %u. Read the model description again.",
    "is_output": "`%s` is an output and cannot be set.",
    "is_fixed": "`%s` is fixed and cannot be set during a run. Set it before, or reset the instance.",
    "inputs_not_finite": "input %s is not finite. Check the component that drives it.",
    "outputs_not_finite": "output %s is not finite. Check the parameters, or reduce the step.",
    # After one or more `is_wrong`.
    "correct_inputs": "%s Connect the input to what gives such values, or leave it at its start value.",
    "correct_parameters": "%s Correct the parameters.",
    # Steps.
    "start_time": "the start time is %s s. Give a finite one.",
    "step_size": "the communication step is %s s. Give a positive one, from a finite time on.",
    "jump": "this step begins %.3g s away from %.9g s, where it is expected."
    " Begin each step where the one before ended, the first at the start time, or set a saved state.",
    "no_fraction": "a communication step of %.9g s is neither a whole multiple nor a whole fraction of"
    " `sample_time` = %.9g s. Change one of them.",
    "too_many_samples": "a communication step of %.9g s holds %.3g samples of `sample_time` = %.9g s."
    " Take shorter steps.",
    "past_sample": "after steps of other sizes, this step of %.9g s ends %.3g s after a sample."
    " Let every sample, at multiples of `sample_time` = %.9g s from the start, be a communication point.",
    # State.
    "other_build": "the saved state is of build %s, this is %s. Save it with this FMU.",
    "damaged_state": "the saved state is damaged: its %s cannot be right. Save it again with this FMU.",
    "small_buffer": "the saved state has %u bytes, the buffer only %u. Ask for the size first.",
    # Only in C: compilers change the arithmetic; memory, files, handles and addresses can be missing there.
    "not_exact": "its sources were compiled with options that change its numbers."
    " Compile them with -ffp-contract=off, and without -ffast-math or the like.",
    "no_memory": "there is not enough memory. Close other instances, or take a machine with more of it.",
    "no_resources": "its file `%s` cannot be read (the tool gave the location `%s`). Unpack the FMU again, all of it.",
    "no_state": "no saved state was given. Save one first.",
    "no_address": "%s was called with NULL for its %s. Give the address of what it is to read or write.",
    # Values of parameters and inputs: name, value, what is expected.
    "is_wrong": "`%s` is %s; expected %s.",
    "number": "a number",
    "whole_number": "a whole number",
    "truth_value": "true or false",
    "text": "a text",
    "choice": "one of %s",
    "finite": "a finite number",
    "at_least": "at least %g%s",
    "at_most": "at most %g%s",
    "from_to": "%g to %g%s",
    "less_than": "less than `%s` = %s",
    "beyond_limit": "%s is %g; expected less than %g: %s.",
    "no_parameter": "there is no parameter `%s`. %s",
    "did_you_mean": "Did you mean `%s`?",
    "remove_it": "Remove it.",
    "of_parameter": "`%s`: %s",  # a problem of its table
    # Tables: file, and what is wrong with it, joined by semicolons.
    "no_file": "`%s` is not a file. Give the path of a CSV file with the columns %s.",
    "no_csv_name": "the name `%s` does not end in .csv. Give the path of a CSV file with the columns %s.",
    "no_csv": "%s: not a CSV file in UTF-8 (%s). Save it as one.",
    "wrong_file": "%s: %s. Correct the file.",
    "columns_twice": "columns %s are both called `%s`",
    "column_unit": "`%s` is in `%s`, but `%s` is expected, and nothing is converted",
    "column_missing": "column %s is missing; the header has %s",
    "no_header": "nothing",
    "few_rows": "%d rows, but at least %d with different `%s` are needed",
    "decreases": "row %d: `%s` decreases from %g to %g",
    "does_not_rise": "row %d: `%s` does not rise from %g to %g",
    "off_grid": "row %d: every `%s` needs the same rows of `%s` as the first, and no others",
    "not_from_zero": "row %d: `%s` and `%s` begin at 0 at every `%s`, not at %g and %g",
    "small_grid": "%d rows, %d for each `%s`, but at least %d times %d are needed",
    "no_number": "row %d: `%s` is `%s`, not a finite number",
    "and_more": "and %u more",
    # Arrays of FMI 3.0.
    "value_count": "%s: these variables have %u values, but there is room for %u. Read their dimensions first.",
    "both_tables": "both the file and the arrays differ from the start values. Change only one of them.",
    "wrong_arrays": "its arrays: %s. Correct them.",
    # A fault of the Python code itself: exception, its text, inputs, traceback.
    "exception": "%s: %s\ninputs: %s\n%s",
}


class Refusal(ValueError):
    """The host or the user asked for something that cannot be done; the message is a sentence that says what to do."""


def say(key: str, *values: Any) -> str:
    """A sentence with its values."""
    return SENTENCES[key] % values
