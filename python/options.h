#pragma once

#include <pybind11/pybind11.h>

namespace tomofield::python {

/// Adds SeriesFiles and Options to the module. Their attributes are named as the members in C++;
/// enums are the words of the command line.
void add_options(pybind11::module_& module);

}  // namespace tomofield::python
