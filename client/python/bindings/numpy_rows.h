// Rows of joint positions in an array of numpy, read in place.
#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace clearance::python {

/// A view of an array, which holds it. Construct and destroy it with the interpreter's lock. Takes a third of the time
/// of nanobind's ndarray.
class NumpyRows {
 public:
  /// Views a C-contiguous (K, columns) array of float64 with K > 0, whose type is exactly numpy's; nothing else.
  NumpyRows(nanobind::handle array, std::size_t columns) {
    static PyTypeObject* const type = reinterpret_cast<PyTypeObject*>(
        nanobind::object(nanobind::module_::import_("numpy").attr("ndarray")).release().ptr());
    if (Py_TYPE(array.ptr()) != type) return;
    if (PyObject_GetBuffer(array.ptr(), &buffer_, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT) != 0) {
      PyErr_Clear();
      return;
    }
    const bool is_aligned = reinterpret_cast<std::uintptr_t>(buffer_.buf) % alignof(double) == 0;
    if (is_aligned && buffer_.ndim == 2 && std::string_view(buffer_.format) == "d" && buffer_.shape[0] > 0 &&
        static_cast<std::size_t>(buffer_.shape[1]) == columns)
      numbers_ = {static_cast<const double*>(buffer_.buf), static_cast<std::size_t>(buffer_.shape[0]) * columns};
  }
  ~NumpyRows() { PyBuffer_Release(&buffer_); }
  NumpyRows(const NumpyRows&) = delete;
  NumpyRows& operator=(const NumpyRows&) = delete;

  /// Empty without a view.
  std::span<const double> numbers() const { return numbers_; }

 private:
  Py_buffer buffer_{};
  std::span<const double> numbers_;
};

}  // namespace clearance::python
