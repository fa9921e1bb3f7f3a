// Read any bytes as a calibration, or as the noise of a calibration, and use what was accepted. For libFuzzer:
//     fuzz_readers -max_total_time=600 CORPUS tests/vectors
#include <random>

#include "skin_calib_json.hpp"

using namespace skin_calib;
using reading::Json;

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

// Return a random value inside of a document.
static Json& somewhere(Json& document, std::minstd_rand& random) {
    Json* value = &document;
    while (value->is_structured() && !value->empty() && random() % 16 != 0) {
        auto item = value->begin();
        std::advance(item, static_cast<std::ptrdiff_t>(random() % value->size()));
        value = &*item;
    }
    return *value;
}

// Change, remove or repeat a value of a JSON file: the result is JSON again, which bytes at random hardly are.
static void change(Json& document, std::minstd_rand& random) {
    static const Json hostile[] = {
        0,          -1,   1,       3,    0.5, 1e-320, 1e308,         -1e308,        2147483647,
        4294967296, 1e-9, nullptr, true, "0", "",     Json::array(), Json::object()};
    Json& value = somewhere(document, random);
    const unsigned kind = random() % 4;
    if (kind == 0 && value.is_array() && !value.empty())
        value.erase(random() % value.size());
    else if (kind == 1 && value.is_array() && !value.empty())
        value.push_back(Json(value[random() % value.size()]));
    else if (kind == 2)
        value = Json(somewhere(document, random));
    else
        value = hostile[random() % std::size(hostile)];
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most, unsigned seed) {
    std::minstd_rand random(seed);
    Json document = Json::parse(data, data + size, nullptr, false);
    if (document.is_discarded() || random() % 8 == 0) return LLVMFuzzerMutate(data, size, most);
    for (unsigned k = 0; k <= random() % 3; ++k) change(document, random);
    const std::string text = document.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (text.size() > most) return LLVMFuzzerMutate(data, size, most);
    std::copy(text.begin(), text.end(), data);
    return text.size();
}

// Update a skin with ordinary readings, and with those that a broken bus may send.
static void use(const Calibration& calibration, const Noise* noise) {
    Skin skin;
    if (calibration.ids.size() > 500 || !skin.start(calibration, {}, noise).ok || skin.reading_length() > 100000)
        return;
    Numbers readings(skin.reading_length());
    double time = 0;
    for (double value : {0.0, 300.0, 1e300, -infinity, not_a_number, 4095.0}) {
        for (std::size_t k = 0; k < readings.size(); ++k) readings[k] = k % 3 ? value : 0.1 * static_cast<double>(k);
        skin.update(readings.data(), readings.size(), time += value);
    }
    skin.update(readings.data(), readings.size() - 1, -time);
    skin.update<float>(nullptr, 0, not_a_number);
}

// Return the calibration to which all noise files of the fuzzer belong: three taxels in a row.
static Calibration three_taxels() {
    Calibration c;
    c.link = "link", c.checksum = "sha256:" + std::string(64, '0');
    c.responses = {Response{}};
    for (int k = 0; k < 3; ++k) {
        const double x = 0.01 * k;
        c.ids.push_back(std::to_string(k)), c.channels.push_back(k), c.response.push_back(0), c.areas.push_back(1e-4);
        c.positions.push_back({x, 0, 0}), c.normals.push_back({0, 0, -1});
        c.corners.push_back(
            {{x - 0.005, -0.005, 0}, {x - 0.005, 0.005, 0}, {x + 0.005, 0.005, 0}, {x + 0.005, -0.005, 0}});
        if (k > 0) c.pairs.push_back({k - 1, k});
    }
    return c;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const Calibration known = three_taxels();
    const std::string_view bytes(reinterpret_cast<const char*>(data), size);
    Calibration calibration;
    Noise noise;
    if (read_calibration(bytes, calibration).ok) use(calibration, nullptr);
    if (read_noise(bytes, known, noise).ok) use(known, &noise);
    return 0;
}
