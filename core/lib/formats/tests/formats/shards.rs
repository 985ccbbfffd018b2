//! Shards of scenes, merged as text.

use serde_json::json;
use syntable_formats::dataset::{DatasetWriter, JsonLayout};
use syntable_formats::shard::{ShardLine, push_annotation, push_image, push_scene, push_view};

#[test]
fn records_keep_their_bytes_and_get_ids() {
    let mut shard = Vec::new();
    push_image(&mut shard, 2, &json!({ "id": 0, "name": "a]\n\"" })).expect("memory");
    push_annotation(&mut shard, &json!({ "id": 0, "image_id": 0, "rate": 0.1 })).expect("memory");
    push_annotation(&mut shard, &json!({ "id": 0, "image_id": 0, "rate": 1e-7 })).expect("memory");
    let text = String::from_utf8(shard).expect("UTF-8");
    assert_eq!(text.lines().count(), 3, "line breaks inside strings are escaped");
    let mut out = Vec::new();
    let mut file = DatasetWriter::new(&mut out, "a.json", JsonLayout::Lines).expect("memory");
    let lines: Vec<ShardLine> = text.lines().map(|line| ShardLine::parse(line).expect("a line")).collect();
    file.images(|images| match lines[0] {
        ShardLine::Image { annotations: 2, record } => images.raw(&record.numbered(4)),
        other => panic!("{other:?}"),
    })
    .expect("memory");
    file.annotations(|annotations| {
        (10..).zip(&lines[1..]).try_for_each(|(id, line)| match line {
            ShardLine::Annotation(record) => annotations.raw(&record.numbered(id, 4)),
            other => panic!("{other:?}"),
        })
    })
    .expect("memory");
    file.finish().expect("memory");
    let want = "{\n    \"images\": [\n{\"id\":4,\"name\":\"a]\\n\\\"\"}\n    ],\n    \"annotations\": [\n\
                {\"id\":10,\"image_id\":4,\"rate\":0.1},\n{\"id\":11,\"image_id\":4,\"rate\":1e-7}\n    ]\n}\n";
    assert_eq!(String::from_utf8(out).expect("UTF-8"), want);
}

#[test]
fn views_and_scenes_have_lines_of_their_own() {
    let mut shard = Vec::new();
    push_view(&mut shard, &json!({ "order": ["0<1"] })).expect("memory");
    push_scene(&mut shard, &json!({ "bodies": [] })).expect("memory");
    let text = String::from_utf8(shard).expect("UTF-8");
    let lines: Vec<Option<ShardLine>> = text.lines().map(ShardLine::parse).collect();
    assert_eq!(lines, [Some(ShardLine::View("{\"order\":[\"0<1\"]}")), Some(ShardLine::Scene("{\"bodies\":[]}"))]);
}

#[test]
fn other_lines_are_not_taken_for_records() {
    for line in [
        "",
        "[]",
        "[\"image\",x,{}]",
        "[\"image\",1]",
        "[\"image\",1,{\"id\":4,\"name\":\"a\"}]",
        "[\"annotation\",{\"image_id\":1}]",
        "[\"annotation\",{\"id\":0,\"image_id\":1,\"rate\":0.1}]",
        "[\"annotation\",{\"id\":5,",
    ] {
        assert_eq!(ShardLine::parse(line), None, "{line}");
    }
}
