// Compare the frames of the golden vectors with those of this runtime: sets, numbers and forces to the bit.
//     vectors FOLDER
#include <cstdio>
#include <filesystem>

#include "skin_calib_json.hpp"

using namespace skin_calib;
using reading::Json;

namespace {

int wrong = 0, compared = 0;
double learned_tolerance = 0; // of a skin that learned its noise, relative: sums of many readings
std::string where;

void report(const char* name, const std::string& expected, const std::string& found) {
    ++wrong;
    std::printf("%s: %s must be %s, not %s\n", where.c_str(), name, expected.c_str(), found.c_str());
}

// Return a number of a file: null is NaN, and infinite numbers are texts.
double number(const Json& x) {
    return x.is_null()     ? not_a_number
           : x.is_string() ? (x.get<std::string>()[0] == '-' ? -infinity : infinity)
                           : x.get<double>();
}

Numbers numbers(const Json& values) {
    Numbers result;
    for (const Json& x : values) result.push_back(number(x));
    return result;
}

void compare(const char* name, const Json& expected, double found, double tolerance) {
    ++compared;
    const double x = number(expected);
    const bool is_equal = x == found || (std::isnan(x) && std::isnan(found));
    if (!(is_equal || std::abs(x - found) <= tolerance + learned_tolerance * (1 + std::abs(x))))
        report(name, expected.dump(), std::to_string(found));
}

template <class Values>
void compare(const char* name, const Json& expected, const std::optional<Values>& found, double tolerance) {
    if (expected.is_null() || !found) {
        if (!expected.is_null() || found) report(name, expected.dump(), found ? "known" : "unknown");
        return;
    }
    for (std::size_t k = 0; k < found->size(); ++k) compare(name, expected.at(k), (*found)[k], tolerance);
}

void compare(const char* name, const Json& expected, const std::optional<double>& found, double tolerance) {
    if (expected.is_null() == found.has_value())
        report(name, expected.dump(), found ? "known" : "unknown");
    else if (found)
        compare(name, expected, *found, tolerance);
}

void compare(const char* name, const Json& expected, const Booleans& found) {
    std::string text;
    for (auto x : found) text += x ? '1' : '0';
    ++compared;
    if (expected != text) report(name, expected.dump(), text);
}

void compare(const char* name, const Json& expected, const std::optional<bool>& found) {
    ++compared;
    if (expected != (found ? Json(*found) : Json(nullptr)))
        report(name, expected.dump(), found ? (*found ? "true" : "false") : "null");
}

// Compare two polygons by area and by the distances of their corners.
void compare(const char* name, const Json& expected, const Polygon& found) {
    Polygon polygon;
    for (const Json& p : expected) polygon.corners.push_back({number(p[0]), number(p[1])});
    compare(name, polygon.area(), found.area(), 1e-9);
    if (polygon.corners.empty() != found.corners.empty()) report(name, expected.dump(), "another polygon");
    for (const Vec2& p : found.corners)
        if (!(polygon.margin(p) >= -1e-8)) report(name, expected.dump(), "a corner outside");
    for (const Vec2& p : polygon.corners)
        if (!(found.margin(p) >= -1e-8)) report(name, expected.dump(), "a missing corner");
}

void compare(const char* name, const Json& expected, const std::string& found) {
    ++compared;
    if (expected != found) report(name, expected.dump(), found);
}

void compare(const Json& expected, const SupportingPolygon& found) {
    compare("outer", expected["outer"], found.outer);
    compare("nominal", expected["nominal"], found.nominal);
    compare("guaranteed", expected["guaranteed"], found.guaranteed);
    compare("outer_probability", expected["outer_probability"], found.outer_probability, 1e-12);
    compare("guaranteed_probability", expected["guaranteed_probability"], found.guaranteed_probability, 1e-12);
}

void add_flags(std::vector<std::string>& names, Flags flags, const std::string& prefix = "") {
    for (unsigned k = 0; k < std::size(flag::names); ++k)
        if (flags & (1u << k)) names.push_back(prefix + flag::names[k]);
}

void compare_names(const char* name, const Json& expected, std::vector<std::string> found) {
    std::sort(found.begin(), found.end());
    ++compared;
    if (expected != Json(found)) report(name, expected.dump(), Json(found).dump());
}

void compare_trusted(const Json& expected, const Trusted& found) {
    compare("trusted", expected["trusted"], Booleans{found.touched, found.wrench, found.point, found.guaranteed});
}

void compare(const Json& expected, const Frame& frame) {
    std::vector<std::string> flags;
    add_flags(flags, frame.flags);
    compare_names("flags", expected["flags"], flags);
    compare("touched", expected["touched"], frame.touched());
    compare("stands", expected["stands"], frame.sets.stands);
    compare("is_standing", expected["is_standing"], std::optional<bool>(frame.stands()));
    compare_trusted(expected, frame.trusted());
    compare("known", expected["known"], frame.known);
    compare("stuck", expected["stuck"], frame.stuck);
    compare("active", expected["active"], frame.sets.active);
    compare("sure", expected["sure"], frame.sets.sure);
    compare("possible", expected["possible"], frame.sets.possible);
    compare("forces", expected["forces"], std::optional<Numbers>(frame.forces), 0.0);
    if (frame.is_known && !frame.force_sigmas.empty())
        compare("force_sigmas", expected["force_sigmas"], std::optional<Numbers>(frame.force_sigmas), 0.0);
    const double size = number(expected["size"]) * 1e-12, arm = frame.load > 0 ? size / frame.load : 0.0;
    const Json& contacts = expected["contacts"];
    if (contacts.size() != frame.contacts.size())
        return report("contacts", std::to_string(contacts.size()), std::to_string(frame.contacts.size()));
    for (std::size_t k = 0; k < contacts.size(); ++k) {
        const Contact& c = frame.contacts[k];
        compare("number", contacts[k]["number"], static_cast<double>(c.number), 0.0);
        if (contacts[k]["taxels"] != Json(Rows(frame.rows.begin() + static_cast<std::ptrdiff_t>(c.begin),
                                               frame.rows.begin() + static_cast<std::ptrdiff_t>(c.end))))
            report("taxels", contacts[k]["taxels"].dump(), "others");
        compare("contact force", contacts[k]["force"], c.force, size);
        compare("contact wrench", contacts[k]["wrench"], std::optional<Vec6>(c.wrench), size);
        compare("position", contacts[k]["position"], std::optional<Vec3>(c.position), 1e-12);
        compare("normal", contacts[k]["normal"], std::optional<Vec3>(c.normal), 1e-12);
        compare("area", contacts[k]["area"], c.area, 1e-12);
        compare("peak_pressure", contacts[k]["peak_pressure"], c.peak_pressure, 1e-12 * c.peak_pressure);
    }
    compare("wrench", expected["wrench"],
            frame.is_known && !frame.is_lost ? std::optional<Vec6>(frame.wrench) : std::nullopt, size);
    compare("load", expected["load"], frame.load, size);
    compare("cop", expected["cop"], frame.cop, arm);
    compare("zmp", expected["zmp"], frame.zmp, arm);
    compare("wrench_sigma", expected["wrench_sigma"], frame.wrench_sigma, 1e-11);
    compare("load_sigma", expected["load_sigma"], frame.load_sigma, 1e-11);
    compare("cop_sigma", expected["cop_sigma"], frame.cop_sigma, 1e-11);
    compare("zmp_sigma", expected["zmp_sigma"], frame.zmp_sigma, 1e-11);
    compare(expected, frame.polygon);
}

Json document(const std::filesystem::path& path) { return Json::parse(reading::contents(path.string())); }

void start(const Json& link, const std::filesystem::path& folder, Skin& skin) {
    const auto file = [&](const char* name) { return (folder / link[name].get<std::string>()).string(); };
    Options options;
    if (link.contains("options")) {
        const Json& given = link["options"];
        if (given.contains("switch_on")) options.switch_on = given["switch_on"].get<double>();
        if (given.contains("switch_off")) options.switch_off = given["switch_off"].get<double>();
        if (given.contains("creep")) options.creep = given["creep"].get<Vec2>();
        if (given.contains("ground"))
            options.ground = Plane::through(given["ground"]["point"].get<Vec3>(), given["ground"]["up"].get<Vec3>());
        options.in_cell = given.value("in_cell", false);
        options.follow_drift = given.value("follow_drift", true);
    }
    const Status status = load(file("calibration"), link["noise"].is_null() ? "" : file("noise"), options, skin);
    if (!status.ok) report("the skin", "valid", status.message);
}

void must_start(const std::string& path, Skin& skin) {
    if (const Status status = load(path, "", {}, skin); !status.ok) report("the skin", "valid", status.message);
}

void compare_skin(const Json& test, const std::filesystem::path& folder) {
    Skin skin;
    learned_tolerance = test.value("learns", false) ? 1e-9 : 0.0;
    start(test, folder, skin);
    for (const Json& expected : test["frames"]) {
        if (expected.contains("mask") && !skin.mask(expected["mask"].get<std::vector<std::string>>()).ok) ++wrong;
        const Numbers readings = numbers(expected["readings"]);
        compare(expected["frame"], skin.update(readings.data(), readings.size(), number(expected["time"])));
    }
}

// Compare what a skin learns at rest, and the refusals.
void compare_tares(const Json& test, const std::filesystem::path& folder) {
    learned_tolerance = 1e-9;
    for (const Json& line : test["tares"]) {
        where = "tare " + line["name"].get<std::string>();
        Skin skin;
        Tare tare;
        must_start((folder / test["calibration"].get<std::string>()).string(), skin);
        Numbers rows;
        for (const Json& row : line["readings"])
            for (const Json& x : row) rows.push_back(number(x));
        const std::size_t frames = line["readings"].size();
        const bool accept = line["accept"].get<bool>();
        const std::vector<std::uint16_t> whole(rows.begin(), rows.end());
        const Status status = line["type"] == "uint16"
                                  ? skin.tare(whole.data(), frames, rows.size() / frames, tare, accept)
                                  : skin.tare(rows.data(), frames, rows.size() / frames, tare, accept);
        if (line.contains("refused")) {
            compare("refused", line["refused"], status.message.substr(0, status.message.find(". ")));
            continue;
        }
        compare("message", "", status.message);
        if (line["warnings"] != Json(tare.warnings))
            report("warnings", line["warnings"].dump(), Json(tare.warnings).dump());
        compare("forces", line["forces"], std::optional<Numbers>(tare.forces), 0.0);
        compare("baseline", line["baseline"], std::optional<Numbers>(skin.baseline()), 0.0);
        const Json found = Json::parse(reading::noise_text(skin))["noise"];
        if (found.is_null() != line["noise"].is_null()) report("noise", line["noise"].dump(), found.dump());
        for (const auto& [name, values] : line["noise"].items()) {
            const auto as_list = [](const Json& x) { return x.is_array() ? x : Json::array({x}); };
            if (name == "dead") continue;
            const Json a = as_list(values), b = as_list(found[name]);
            for (std::size_t i = 0; i < a.size(); ++i) { // infinite numbers are texts here, and null in files
                ++compared;
                if (!a[i].is_number() || !b[i].is_number()
                        ? b[i].is_number() != a[i].is_number()
                        : !(std::abs(number(a[i]) - number(b[i])) <= 1e-9 * (1 + std::abs(number(a[i])))))
                    report(name.c_str(), a[i].dump(), b[i].dump());
            }
        }
    }
}

void compare_body(const Json& test, const std::filesystem::path& folder) {
    Body body;
    std::vector<std::string> names;
    for (const Json& link : test["links"]) {
        start(link, folder, body.add());
        names.push_back(link["name"].get<std::string>());
    }
    body.start();
    for (const Json& test_frame : test["frames"]) {
        std::vector<LinkInput> inputs(names.size());
        std::vector<Numbers> readings(names.size());
        std::vector<Pose> poses(names.size());
        for (std::size_t k = 0; k < names.size(); ++k) {
            if (test_frame["readings"].contains(names[k])) {
                readings[k] = numbers(test_frame["readings"][names[k]]);
                inputs[k].readings = readings[k].data(), inputs[k].count = readings[k].size();
            }
            if (!test_frame["poses"].contains(names[k])) continue;
            const Json& pose = test_frame["poses"][names[k]];
            for (std::size_t i = 0; i < 4; ++i)
                for (std::size_t j = 0; j < 4; ++j) poses[k][i][j] = number(pose[i][j]);
            inputs[k].pose = &poses[k];
        }
        const BodyFrame& frame = body.update(inputs.data(), number(test_frame["time"]));
        const Json& expected = test_frame["frame"];
        std::vector<std::string> flags, lost, standing;
        add_flags(flags, frame.flags);
        for (std::size_t k = 0; k < names.size(); ++k) {
            add_flags(flags, frame.link_flags[k], names[k] + ":");
            if (frame.lost[k]) lost.push_back(names[k]);
            if (frame.standing[k]) standing.push_back(names[k]);
        }
        compare_names("flags", expected["flags"], flags);
        compare_trusted(expected, frame.trusted);
        compare_names("lost", expected["lost"], lost);
        compare_names("standing", expected["standing"], standing);
        compare("wrench", expected["wrench"], frame.wrench, 1e-9);
        compare("cop", expected["cop"], frame.cop, 1e-12);
        compare("zmp", expected["zmp"], frame.zmp, 1e-12);
        compare("cop_sigma", expected["cop_sigma"], frame.cop_sigma, 1e-11);
        compare("zmp_sigma", expected["zmp_sigma"], frame.zmp_sigma, 1e-11);
        if (expected["outer"].is_null() != frame.is_foot_lost) report("outer", expected["outer"].dump(), "another one");
        if (!frame.is_foot_lost) compare(expected, frame.polygon);
    }
}

} // namespace

int main(int count, char** arguments) {
    int cases = 0;
    for (const auto& entry : std::filesystem::directory_iterator(count > 1 ? arguments[1] : ".")) {
        const std::string name = entry.path().filename().string();
        if (name == "mixed.tare.json") compare_tares(document(entry.path()), entry.path().parent_path());
        if (name.size() < 10 || name.substr(name.size() - 10) != ".case.json") continue;
        where = name;
        ++cases;
        const Json test = document(entry.path());
        test.contains("links") ? compare_body(test, entry.path().parent_path())
                               : compare_skin(test, entry.path().parent_path());
    }
    std::printf("%d cases, %d values, %d differences\n", cases, compared, wrong);
    return wrong != 0 || cases == 0;
}
