// What is wrong gives a status or a flag, and `update` allocates no memory.
//     bad_input FOLDER
#include <cstdio>
#include <cstdlib>
#include <new>

#include "skin_calib_json.hpp"

using namespace skin_calib;

static std::size_t allocations = 0;

// Not inlined: gcc would take them for another pair than new and delete.
[[gnu::noinline]] void* operator new(std::size_t size) {
    ++allocations;
    if (void* memory = std::malloc(size ? size : 1)) return memory;
    throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace {

int wrong = 0;

void must(bool is_true, const char* what, const char* of = "") {
    if (!is_true) ++wrong, std::printf("wrong: %s%s\n", what, of);
}

using Change = void (*)(reading::Json&);
using reading::Json;

void refuses_files(const std::string& folder) {
    constexpr const char* truncated = "a truncated calibration is refused";
    const std::string bytes = reading::contents(folder + "/small.calibration.json"),
                      noise_bytes = reading::contents(folder + "/creep.noise.json");
    Calibration calibration, unchanged;
    Noise noise;
    must(read_calibration(bytes, calibration).ok, "a valid calibration is accepted");
    must(read_noise(noise_bytes, calibration, noise).ok, "its noise is accepted");
    for (std::size_t length = 0; length + 2 < bytes.size(); length += 101)
        must(!read_calibration(bytes.substr(0, length), unchanged).ok, truncated);
    must(!read_calibration(std::string(100000, '['), unchanged).ok, "deep nesting is refused");
    must(!load_calibration(folder + "/missing.json", unchanged).ok, "a missing file is refused");
    must(unchanged.ids.empty(), "a refused file changes nothing");
    const std::pair<const char*, Change> changes[] = {
        {"version", [](Json& d) { d["version"] = 2; }},
        {"format", [](Json& d) { d["format"] = "skin-plan"; }},
        {"list as number", [](Json& d) { d["patches"][0]["taxels"]["area"] = 3; }},
        {"length", [](Json& d) { d["patches"][0]["taxels"]["area"].push_back(1e-4); }},
        {"negative area", [](Json& d) { d["patches"][0]["taxels"]["area"][0] = -1e-4; }},
        {"position", [](Json& d) { d["patches"][0]["taxels"]["position"][1][2] = 1e200; }},
        {"normal", [](Json& d) { d["patches"][0]["taxels"]["normal"][1] = {0, 0, 0}; }},
        {"channel", [](Json& d) { d["patches"][0]["taxels"]["channel"][1] = 0; }},
        {"huge channel", [](Json& d) { d["patches"][0]["taxels"]["channel"][1] = 1e18; }},
        {"unknown neighbour", [](Json& d) { d["patches"][0]["taxels"]["neighbours"][1] = {"nobody"}; }},
        {"equal ids", [](Json& d) { d["patches"][0]["taxels"]["id"][1] = d["patches"][0]["taxels"]["id"][0]; }},
        {"corners", [](Json& d) { d["patches"][0]["taxels"]["corners"][1] = Json::array(); }},
        {"response", [](Json& d) { d["patches"][0]["taxels"]["response"] = Json(17, 5); }},
        {"no coefficients", [](Json& d) { d["response"]["coefficients"] = Json::array(); }},
        {"range", [](Json& d) { d["response"]["range"] = {5, 5}; }},
        {"table", [](Json& d) { d["response"] = {{"kind", "table"}, {"readings", {0, 0}}, {"forces", {0, 1}}}; }},
        {"no taxels", [](Json& d) { d["patches"] = Json::array(); }},
    };
    for (const auto& [name, change] : changes) {
        Json document = Json::parse(bytes);
        change(document);
        const Status status = read_calibration(document.dump(), unchanged);
        must(!status.ok && !status.message.empty(), "refused: ", name);
    }
    const std::pair<const char*, Change> noise_changes[] = {
        {"checksum", [](Json& d) { d["calibration"] = "sha256:0"; }},
        {"length", [](Json& d) { d["noise"]["mean"].erase(0); }},
        {"null", [](Json& d) { d["noise"]["mean"][0] = nullptr; }},
        {"sigma", [](Json& d) { d["noise"]["sigma"][0] = 0; }},
        {"sign", [](Json& d) { d["noise"]["sign"][0] = -1; }},
        {"lowest", [](Json& d) { d["noise"]["lowest"][0] = nullptr; }},
        {"repeats", [](Json& d) { d["noise"]["repeats"][0] = 0; }},
        {"frame_repeats", [](Json& d) { d["noise"]["frame_repeats"] = -1; }},
        {"limits", [](Json& d) { d["noise"].erase("detection_limits"); }},
        {"dead", [](Json& d) { d["noise"]["dead"][0] = 1; }},
        {"baseline", [](Json& d) { d.erase("baseline"); }},
    };
    for (const auto& [name, change] : noise_changes) {
        Json document = Json::parse(noise_bytes);
        change(document);
        must(!read_noise(document.dump(), calibration, noise).ok, "noise refused: ", name);
    }
    Skin skin;
    Options options;
    options.switch_on = -1.0;
    must(!skin.start(calibration, options).ok, "negative thresholds are refused");
    options = {}, options.creep = Vec2{0.1, 0.0};
    must(!skin.start(calibration, options).ok, "creep without time is refused");
    options = {}, options.ground = Plane{{not_a_number, 0, 0}, {}};
    must(!skin.start(calibration, options).ok, "a ground that is not finite is refused");
    must(skin.update<double>(nullptr, 0, 0.0).has(flag::wrong_length), "a skin that was not started knows nothing");
}

// Readings of every kind give frames with flags, without a single allocation.
void flags_readings(const std::string& folder) {
    Skin skin;
    must(load(folder + "/sole.calibration.json", folder + "/noise.noise.json", {}, skin).ok, "the skin is valid");
    must(!skin.mask({"nobody"}).ok, "an unknown taxel is not masked");
    const std::size_t n = skin.reading_length();
    Numbers readings(n, 0.0);
    std::vector<std::uint16_t> counts(n, 500);
    const std::size_t before = allocations;
    const auto flags = [&](double time) { return skin.update(readings.data(), readings.size(), time).flags; };
    const auto flags_of = [&](const auto& values, double time) { return skin.update(values.data(), n, time).flags; };
    must(skin.update(counts.data(), n, 0.0).stands(), "whole numbers are readings");
    must(skin.update(counts.data(), n - 1, 0.001).has(flag::wrong_length), "short readings are flagged");
    must(!skin.update(counts.data(), n - 1, 0.002).touched(), "then nothing is known");
    must(!skin.update(counts.data(), n - 1, 0.002).trusted().guaranteed, "and nothing is guaranteed");
    must(flags(not_a_number) & flag::time_not_finite, "a time that is not finite is flagged");
    must(flags(-5.0) & flag::time_back, "time that goes back is flagged");
    must(flags(-5.0) & flag::time_still, "time that stands still is flagged");
    must(flags(1e300) & flag::time_jump, "a jump is flagged");
    readings[3] = not_a_number, readings[4] = infinity, readings[5] = 1e300;
    must((flags(1e300) & (flag::not_finite | flag::too_large)) == (flag::not_finite | flag::too_large),
         "broken taxels are flagged");
    std::fill(readings.begin(), readings.end(), not_a_number);
    must(flags(1e300) & flag::blind, "a blind skin is flagged");
    unsigned state = 1;
    for (int k = 0; k < 3000; ++k) {
        for (double& x : readings) {
            state = state * 1664525u + 1013904223u;
            const unsigned kind = state >> 28;
            x = kind == 0 ? not_a_number : kind == 1 ? -1e300 : kind < 9 ? 0.0 : static_cast<double>(state >> 20);
        }
        skin.update(readings.data(), readings.size(), 0.001 * k);
    }
    for (int k = 0; k < 30; ++k) skin.update(counts.data(), n, 4.0 + 0.04 * k);
    must((flags_of(counts, 5.2) & (flag::frozen | flag::stuck)) == (flag::frozen | flag::stuck),
         "a frozen bus is flagged");
    for (int k = 0; k < 100; ++k) { // readings below those of the tare
        for (double& x : readings) {
            state = state * 1664525u + 1013904223u;
            x = -6.0 + static_cast<double>(state >> 30);
        }
        skin.update(readings.data(), n, 5.24 + 0.04 * k);
    }
    must(flags(9.3) & flag::drift, "a drift is flagged");
    must(allocations == before, "update allocates no memory");
}

// A tare refuses what it must; a skin that has learned allocates no memory, and its file is that of the skin.
void learns(const std::string& folder) {
    Skin skin;
    Tare tare;
    std::vector<std::uint16_t> rows;
    must(!skin.tare(rows.data(), 1, 1, tare).ok, "a skin that was not started learns nothing");
    must(load(folder + "/small.calibration.json", "", {}, skin).ok, "the skin is valid");
    const std::size_t n = skin.reading_length();
    must(!skin.tare<double>(nullptr, 5, n, tare).ok, "no readings are refused");
    unsigned state = 1;
    const auto quiet = [&] { return static_cast<std::uint16_t>((state = state * 1664525u + 1013904223u) >> 30); };
    for (std::size_t k = 0; k < 250 * n; ++k) rows.push_back(quiet());
    must(!skin.tare(rows.data(), 250, n - 1, tare).ok, "short readings are refused");
    const Numbers broken(40 * n, not_a_number), huge(40 * n, 1e300);
    (void)skin.tare(broken.data(), 40, n, tare, true), (void)skin.tare(huge.data(), 40, n, tare, true);
    for (std::size_t k = 0; k < 400; ++k) skin.update(rows.data() + (k % 250) * n, n, 0.004 * static_cast<double>(k));
    must(skin.noise().has_value(), "a skin learns from its first quiet frames");
    must(skin.update(rows.data(), n, 1.604).has(flag::rest_assumed), "and says that it assumes a rest");
    const std::size_t before = allocations;
    for (std::size_t k = 0; k < 400; ++k)
        skin.update(rows.data() + (k % 250) * n, n, 1.608 + 0.004 * static_cast<double>(k));
    must(allocations == before, "once it has learned, update allocates no memory");
    must(skin.tare(rows.data(), 250, n, tare).ok && tare.has_noise, "a tare is accepted");
    must(!skin.update(rows.data(), n, 4.0).has(flag::rest_assumed | flag::noise_unknown), "after it the rest is known");
    const std::string path = "learned.noise.json", refused = "/nowhere/learned.noise.json";
    must(!save_noise(refused, skin).ok, "a file that cannot be written");
    must(save_noise(path, skin).ok, "the noise is saved");
    Skin again;
    must(load(folder + "/small.calibration.json", path, {}, again).ok, "and read");
    must(again.baseline() == skin.baseline() && again.noise()->sure == skin.noise()->sure, "to the bit");
    std::remove(path.c_str());
    must(sha256("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad", "the hash of FIPS 180-4");
    Json document = Json::parse(reading::contents(folder + "/small.calibration.json"));
    document["modalities"] = Json::array({{{"name", "proximity"}}});
    std::ofstream("modalities.calibration.json") << document;
    const Status status = load("modalities.calibration.json", "", {}, again);
    must(status.ok && status.message.find("proximity") != std::string::npos, "a modality that is left out is named");
    std::remove("modalities.calibration.json");
}

void flags_bodies(const std::string& folder) {
    Body body;
    for (const char* name : {"small", "right"})
        must(load(folder + "/" + name + ".calibration.json", "", {}, body.add()).ok, "a foot is valid");
    body.start();
    const Numbers readings(body.skins[0]->reading_length(), 100.0);
    Pose pose{};
    for (std::size_t k = 0; k < 4; ++k) pose[k][k] = 1.0;
    LinkInput inputs[] = {{readings.data(), readings.size(), &pose}, {readings.data(), readings.size(), &pose}};
    const std::size_t before = allocations;
    must(body.update(inputs, 0.0).zmp.has_value(), "two feet have a ZMP");
    must(body.update(inputs, 0.0).polygon.outer.area() > 0, "and a polygon");
    must(body.update(nullptr, 0.1).is_foot_lost, "no inputs: nothing is known");
    inputs[1].pose = nullptr;
    must(!body.update(inputs, 0.2).wrench, "a foot without pose");
    inputs[1].pose = &pose;
    pose[0][3] = 1e308;
    must(!body.update(inputs, 0.3).is_foot_lost, "a pose far away overflows, and does no harm");
    pose[0][0] = not_a_number;
    must(body.update(inputs, 0.4).link_flags[0] & flag::no_pose, "a pose that is not finite is flagged");
    must(allocations == before, "the update of a body allocates no memory");
}

} // namespace

int main(int count, char** arguments) {
    const std::string folder = count > 1 ? arguments[1] : ".";
    refuses_files(folder);
    flags_readings(folder);
    learns(folder);
    flags_bodies(folder);
    std::printf("%d wrong\n", wrong);
    return wrong != 0;
}
