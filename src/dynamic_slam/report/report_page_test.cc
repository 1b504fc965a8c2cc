#include "dynamic_slam/report/report_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/report/data_uri.h"
#include "dynamic_slam/report/path_section.h"

namespace dynamic_slam {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

// The data as a browser would read it.
nlohmann::ordered_json DataOf(const std::string& page) {
  const std::string mark = "<script id=\"data\" type=\"application/json\">";
  const size_t begin = page.find(mark) + mark.size();
  return nlohmann::ordered_json::parse(page.substr(begin, page.find("</script>", begin) - begin));
}

TEST(ReportPage, HoldsTheDataWhateverIsInIt) {
  const std::string hostile = "</script><b>@SCRIPT@ & \"quoted\" <!-- \xff";
  ReportPage page{.title = hostile, .subtitle = "", .times_s = {0, 0.5}};
  page.sections.push_back({{"type", "tiles"}, {"tiles", nlohmann::ordered_json::array()}});
  const std::string text = PageText(page);
  const nlohmann::ordered_json data = DataOf(text);
  EXPECT_THAT(data["title"].get<std::string>(), StartsWith("</script><b>@SCRIPT@ & \"quoted\" <!-- "));
  EXPECT_EQ(data["times"], nlohmann::ordered_json({0, 0.5}));
  EXPECT_THAT(text, HasSubstr("<title>&lt;/script>&lt;b>@SCRIPT@ &amp;"));
}

TEST(ReportPage, NeedsNothingBesideItself) {
  const std::string text = PageText({.title = "t", .subtitle = "", .times_s = {}});
  EXPECT_THAT(text, HasSubstr("\"use strict\""));
  for (const char* outside :
       {"@STYLE@", "@SCRIPT@", "@DATA@", "<script src", "<link rel=\"stylesheet\"", "@import", "https://"}) {
    EXPECT_THAT(text, Not(HasSubstr(outside)));
  }
}

TEST(Rounded, IsShortAndNullForWhatIsNoNumber) {
  EXPECT_EQ(Rounded(1.23456, 2).dump(), "1.23");
  EXPECT_EQ(Rounded(-2.0001, 2).dump(), "-2");
  EXPECT_EQ(Rounded(std::nan(""), 2).dump(), "null");
}

TEST(PathsSection, MovesTheTrackAndKeepsErrorsWithTheirPoses) {
  Trajectory path;
  for (int i = 0; i < 5; ++i)
    path.push_back({10.0 + i, {Eigen::Quaterniond::Identity(), {1.0 * i, 0, 2.0 * i}}});
  PathPicture picture{.title = "Path", .note = "", .start_s = 10, .truth = path, .tracks = {}};
  picture.tracks.push_back({.name = "estimate",
                            .colour = "c1",
                            .path = path,
                            .shown_from_world = {2, Eigen::Quaterniond::Identity(), {0, 1, 0}},
                            .errors = {{11, 0.5, 0}, {13, 0.25, 0}}});
  const nlohmann::ordered_json section = PathsSection(picture);
  const nlohmann::ordered_json& track = section["tracks"][0];
  EXPECT_EQ(track["p"], nlohmann::ordered_json({{0, 2, 4, 6, 8}, {1, 1, 1, 1, 1}, {0, 4, 8, 12, 16}}));
  EXPECT_EQ(track["e"], nlohmann::ordered_json({nullptr, 0.5, nullptr, 0.25, nullptr}));
  EXPECT_EQ(track["t"], nlohmann::ordered_json({0, 1, 2, 3, 4}));
  EXPECT_EQ(section["colour"]["max"], 0.5);
  EXPECT_EQ(section["unit"], "m");
  // Of a car's camera, x-z is the ground, and y points down.
  EXPECT_EQ(section["views"][0]["yName"], "z");
  EXPECT_EQ(section["views"][1]["yName"], "−y");
  EXPECT_EQ(section["views"][1]["sy"], -1);
}

TEST(JpegDataUri, IsBase64OfAJpeg) {
  const std::string uri = JpegDataUri(cv::Mat(8, 8, CV_8UC3, cv::Scalar(0, 0, 255)), 80);
  EXPECT_THAT(uri, StartsWith("data:image/jpeg;base64,/9j/"));  // FF D8 FF
  EXPECT_EQ((uri.size() - std::string("data:image/jpeg;base64,").size()) % 4, 0u);
}

}  // namespace
}  // namespace dynamic_slam
