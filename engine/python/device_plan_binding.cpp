#include "engine/python/device_plan_binding.h"

#include <nanobind/ndarray.h>

namespace clearance::python {

namespace {
using AnyArray = nb::ndarray<nb::ro, nb::c_contig>;
}  // namespace

void bind_device_plan(nb::module_& m) {
  nb::class_<PyDevicePlan>(m, "DevicePlan")
      .def_prop_ro("shape", &PyDevicePlan::shape)
      .def_prop_ro("device", &PyDevicePlan::device)
      .def("own_columns", &PyDevicePlan::own_columns)
      .def("run", &PyDevicePlan::run, nb::arg("poses"), nb::arg("positions"), nb::arg("columns"), nb::arg("stream"));
  m.def(
      "exported_array",
      [](const AnyArray& array) {
        std::vector<std::size_t> shape(array.ndim());
        for (std::size_t i = 0; i < shape.size(); ++i) shape[i] = array.shape(i);
        const auto type = array.dtype();
        return nb::make_tuple(reinterpret_cast<std::uintptr_t>(array.data()), nb::tuple(nb::cast(shape)), type.code,
                              type.bits, array.device_type(), array.device_id());
      },
      nb::arg("array"),
      "Address, shape, type code and bits, kind and number of the device, of an array with __dlpack__ in C order.");
}

}  // namespace clearance::python
