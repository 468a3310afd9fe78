#pragma once

#include <pybind11/pybind11.h>

namespace tomofield::python {

/// Adds Choices to the module, whose attributes are the options of the table by their names. Enums
/// are words, and options that nobody chose are None. FILES lists those that are files.
void add_options(pybind11::module_& module);

}  // namespace tomofield::python
