// The C++ runtime as a Python module, to compare it with the Python runtime. Results have the names that
// tests/vectors/make.py records. It is no part of the Python package.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "skin_calib_json.hpp"

namespace py = pybind11;
using namespace skin_calib;

namespace {

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

void raise(const Status& status) {
    if (!status.ok) throw py::value_error(status.message);
}

Options options_of(const py::dict& given) {
    Options options;
    for (const auto& [key, value] : given) {
        const auto name = key.cast<std::string>();
        if (name == "switch_on") options.switch_on = value.cast<double>();
        if (name == "switch_off") options.switch_off = value.cast<double>();
        if (name == "in_cell") options.in_cell = value.cast<bool>();
        if (name == "follow_drift") options.follow_drift = value.cast<bool>();
        if (name == "creep") options.creep = value.cast<Vec2>();
        if (name == "ground") options.ground = Plane::through(value["point"].cast<Vec3>(), value["up"].cast<Vec3>());
    }
    return options;
}

void start(Skin& skin, const std::string& calibration_file, const std::optional<std::string>& noise_file,
           const py::dict& options) {
    Calibration calibration;
    Noise noise;
    raise(read_calibration(calibration_file, calibration));
    if (noise_file) raise(read_noise(*noise_file, calibration, noise));
    raise(skin.start(calibration, options_of(options), noise_file ? &noise : nullptr));
}

template <class Value> py::array_t<Value> array(const std::vector<Value>& values) {
    return py::array_t<Value>(static_cast<py::ssize_t>(values.size()), values.data());
}

py::array_t<bool> booleans(const Booleans& values) {
    py::array_t<bool> result(static_cast<py::ssize_t>(values.size()));
    std::copy(values.begin(), values.end(), result.mutable_data());
    return result;
}

std::vector<bool> statements(const Trusted& trusted) {
    return {trusted.touched, trusted.wrench, trusted.point, trusted.guaranteed};
}

py::list names_of(Flags flags) {
    py::list result;
    for (unsigned k = 0; k < std::size(flag::names); ++k)
        if (flags & (1u << k)) result.append(flag::names[k]);
    return result;
}

void add_polygon(py::dict& result, const SupportingPolygon& polygon) {
    const auto corners = [](const Polygon& p) {
        return py::array_t<double>({static_cast<py::ssize_t>(p.corners.size()), py::ssize_t{2}},
                                   p.corners.empty() ? nullptr : p.corners[0].data());
    };
    result["outer"] = corners(polygon.outer);
    result["nominal"] = corners(polygon.nominal);
    result["guaranteed"] = corners(polygon.guaranteed);
    result["outer_probability"] = polygon.outer_probability;
    result["guaranteed_probability"] = polygon.guaranteed_probability;
}

template <class AnyFrame> void add_points(py::dict& result, const AnyFrame& frame) {
    result["cop"] = frame.cop;
    result["zmp"] = frame.zmp;
    result["cop_sigma"] = frame.cop_sigma;
    result["zmp_sigma"] = frame.zmp_sigma;
}

py::dict record(const Frame& frame) {
    py::dict result;
    result["flags"] = names_of(frame.flags);
    result["touched"] = frame.touched();
    result["trusted"] = statements(frame.trusted());
    result["known"] = booleans(frame.known);
    result["stuck"] = booleans(frame.stuck);
    result["forces"] = array(frame.forces);
    result["stands"] = frame.sets.stands;
    result["active"] = booleans(frame.sets.active);
    result["sure"] = booleans(frame.sets.sure);
    result["possible"] = booleans(frame.sets.possible);
    py::list contacts;
    for (const Contact& c : frame.contacts) {
        py::dict contact;
        contact["number"] = c.number;
        contact["taxels"] = array(Rows(frame.rows.begin() + static_cast<std::ptrdiff_t>(c.begin),
                                       frame.rows.begin() + static_cast<std::ptrdiff_t>(c.end)));
        contact["force"] = c.force;
        contact["wrench"] = c.wrench;
        contact["position"] = c.position;
        contact["normal"] = c.normal;
        contact["area"] = c.area;
        contact["peak_pressure"] = c.peak_pressure;
        contacts.append(contact);
    }
    result["contacts"] = contacts;
    const bool has_sums = frame.is_known && !frame.is_lost;
    result["wrench"] = has_sums ? std::optional<Vec6>(frame.wrench) : std::nullopt;
    result["load"] = has_sums ? std::optional<double>(frame.load) : std::nullopt;
    result["is_standing"] = frame.stands();
    result["wrench_sigma"] = frame.wrench_sigma;
    result["force_sigmas"] =
        frame.is_known && !frame.force_sigmas.empty() ? py::object(array(frame.force_sigmas)) : py::none();
    result["load_sigma"] = frame.load_sigma;
    add_points(result, frame);
    add_polygon(result, frame.polygon);
    return result;
}

struct BodyOf {
    Body body;
    std::vector<std::string> names;

    // Each link is (name, calibration file, noise file or None, options).
    explicit BodyOf(const py::list& links) {
        for (const auto& link : links) {
            const auto items = link.cast<py::tuple>();
            names.push_back(items[0].cast<std::string>());
            start(body.add(), items[1].cast<std::string>(), items[2].cast<std::optional<std::string>>(),
                  items[3].cast<py::dict>());
        }
        body.start();
    }

    py::dict update(const py::dict& readings, double time, const py::dict& poses) {
        std::vector<LinkInput> inputs(names.size());
        std::vector<Doubles> kept;
        std::vector<Pose> matrices(names.size());
        for (std::size_t k = 0; k < names.size(); ++k) {
            const py::str name(names[k]);
            if (readings.contains(name)) {
                kept.push_back(readings[name].cast<Doubles>());
                inputs[k].readings = kept.back().data();
                inputs[k].count = static_cast<std::size_t>(kept.back().size());
            }
            if (poses.contains(name)) {
                matrices[k] = poses[name].cast<Pose>();
                inputs[k].pose = &matrices[k];
            }
        }
        const BodyFrame& frame = body.update(inputs.data(), time);
        py::dict result;
        py::list flags = names_of(frame.flags), lost, standing;
        for (std::size_t k = 0; k < names.size(); ++k) {
            for (const auto& flag : names_of(frame.link_flags[k]))
                flags.append(names[k] + ":" + flag.cast<std::string>());
            if (frame.lost[k]) lost.append(names[k]);
            if (frame.standing[k]) standing.append(names[k]);
        }
        result["flags"] = flags;
        result["trusted"] = statements(frame.trusted);
        result["lost"] = lost;
        result["standing"] = standing;
        result["wrench"] = frame.wrench;
        add_points(result, frame);
        add_polygon(result, frame.polygon);
        for (const char* kind : {"outer", "nominal", "guaranteed"})
            if (frame.is_foot_lost) result[kind] = py::none();
        return result;
    }
};

} // namespace

PYBIND11_MODULE(skin_calib_cpp, module) {
    module.def("measure", [](const std::vector<Vec2>& corners, const Vec2& point) {
        const Polygon polygon{corners};
        return py::make_tuple(polygon.area(), polygon.contains(point), polygon.margin(point), polygon.closest(point));
    });
    py::class_<Skin>(module, "Skin")
        .def(py::init(
                 [](const py::bytes& calibration, const std::optional<std::string>& noise, const py::dict& options) {
                     auto skin = std::make_unique<Skin>();
                     start(*skin, calibration, noise, options);
                     return skin;
                 }),
             py::arg("calibration"), py::arg("noise") = py::none(), py::arg("options") = py::dict())
        .def("tare",
             [](Skin& skin, const Doubles& rows, const std::string& type, bool accept) {
                 Tare tare;
                 const auto frames = static_cast<std::size_t>(rows.shape(0)),
                            channels = static_cast<std::size_t>(rows.shape(1));
                 Status status;
                 if (type == "uint16") {
                     const std::vector<std::uint16_t> whole(rows.data(), rows.data() + rows.size());
                     status = skin.tare(whole.data(), frames, channels, tare, accept);
                 } else {
                     status = skin.tare(rows.data(), frames, channels, tare, accept);
                 }
                 return py::make_tuple(status.message, array(tare.forces), tare.has_noise, tare.warnings);
             })
        .def("save_noise", [](const Skin& skin, const std::string& path) { raise(save_noise(path, skin)); })
        .def("mask", [](Skin& skin, const std::vector<std::string>& ids) { raise(skin.mask(ids)); })
        .def("update", [](Skin& skin, const Doubles& readings, double time) {
            return record(skin.update(readings.data(), static_cast<std::size_t>(readings.size()), time));
        });
    py::class_<BodyOf>(module, "Body").def(py::init<const py::list&>()).def("update", &BodyOf::update);
}
