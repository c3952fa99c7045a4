package main

import (
	"context"
	"fmt"
	"io"
	"log"
	"os"

	"google.golang.org/grpc"
	"google.golang.org/grpc/credentials/insecure"

	pb "example.com/sketch/sketchmatch/v1"
)

func main() {
	connection := must(grpc.Dial("localhost:50051", grpc.WithTransportCredentials(insecure.NewCredentials())))
	request := &pb.MatchRequest{
		Sketch: &pb.Source{Kind: &pb.Source_File{File: &pb.EncodedFile{
			Name: "sketch.svg", Data: must(os.ReadFile("sketch.svg"))}}},
		Map: &pb.Source{Kind: &pb.Source_MapServerMap{MapServerMap: &pb.MapServerMap{
			Yaml: string(must(os.ReadFile("room.yaml"))), Image: must(os.ReadFile("room.pgm"))}}},
	}
	stream := must(pb.NewMatchServiceClient(connection).Match(context.Background(), request))
	for event, err := stream.Recv(); err != io.EOF; event, err = stream.Recv() {
		for _, line := range must(event, err).GetResult().GetObjectMatches() {
			fmt.Println(line.GetSketchLabel(), "is object", line.GetMapObject())
		}
	}
}

func must[T any](value T, err error) T {
	if err != nil {
		log.Fatal(err)
	}
	return value
}
